"""The language server: pygls hands over what an editor asks, `language` answers."""

import asyncio
from importlib.metadata import version
from pathlib import Path

from lsprotocol import types
from pygls.lsp.server import LanguageServer
from pygls.uris import from_fs_path, to_fs_path

from tactograph.rings.editor.language.complete import offers_at
from tactograph.rings.editor.language.cursor import Cursor, find_cursor
from tactograph.rings.editor.language.explain import definition_at, words_at
from tactograph.rings.editor.language.mistakes import Mistake, check
from tactograph.sdk import Graph

PAUSE_S = 0.3
"""Time without a key before a text is checked."""
server = LanguageServer("tactograph", version("tactograph"))
AtPosition = types.CompletionParams | types.HoverParams | types.DefinitionParams
_graphs: dict[str, Graph] = {}
"""The graph of each open file as it was last right."""


@server.feature(types.TEXT_DOCUMENT_DID_OPEN)
@server.feature(types.TEXT_DOCUMENT_DID_CHANGE)
async def check_soon(params: types.DidOpenTextDocumentParams) -> None:
    """Check a text as soon as nobody types."""
    uri = params.text_document.uri
    document = server.workspace.get_text_document(uri)
    before = document.version
    await asyncio.sleep(PAUSE_S)
    if document.version != before:
        return
    result = await asyncio.to_thread(check, document.source, _file(uri))
    if result.graph is not None:
        _graphs[uri] = result.graph
    if document.version == before:
        diagnostics = [_diagnostic(each) for each in result.mistakes]
        server.text_document_publish_diagnostics(
            types.PublishDiagnosticsParams(uri, diagnostics, document.version)
        )


@server.feature(
    types.TEXT_DOCUMENT_COMPLETION, types.CompletionOptions(trigger_characters=[".", "$", "{", " "])
)
def complete(params: types.CompletionParams) -> list[types.CompletionItem]:
    """The words that fit at the cursor."""
    cursor, uri = _cursor(params), params.text_document.uri
    if cursor is None:
        return []
    line, end = params.position.line, params.position.character
    typed = _range(line, end - len(cursor.word), end)
    return [
        types.CompletionItem(
            word, documentation=about or None, text_edit=types.TextEdit(typed, word)
        )
        for word, about in offers_at(cursor, _file(uri), _graphs.get(uri)).items()
    ]


@server.feature(types.TEXT_DOCUMENT_HOVER)
def explain(params: types.HoverParams) -> types.Hover | None:
    """What the word at the cursor means."""
    cursor, uri = _cursor(params), params.text_document.uri
    words = words_at(cursor, _file(uri), _graphs.get(uri)) if cursor else ""
    return types.Hover(types.MarkupContent(types.MarkupKind.Markdown, words)) if words else None


@server.feature(types.TEXT_DOCUMENT_DEFINITION)
def define(params: types.DefinitionParams) -> types.Location | None:
    """Where the word at the cursor is defined."""
    cursor, uri = _cursor(params), params.text_document.uri
    spot = definition_at(cursor, _file(uri), _graphs.get(uri)) if cursor else None
    file = from_fs_path(str(spot.file.resolve())) if spot else None
    return types.Location(file, _range(spot.line, 0, 0)) if spot and file else None


@server.feature(types.TEXT_DOCUMENT_CODE_ACTION)
def mend(params: types.CodeActionParams) -> list[types.CodeAction]:
    """Put the word that was meant in place of a mistake."""
    return [
        types.CodeAction(
            f"Write '{word}'",
            types.CodeActionKind.QuickFix,
            [diagnostic],
            edit=types.WorkspaceEdit(
                {params.text_document.uri: [types.TextEdit(diagnostic.range, word)]}
            ),
        )
        for diagnostic in params.context.diagnostics
        for word in (diagnostic.data or {}).get("meant", ())
    ]


def _file(uri: str) -> Path:
    return Path(to_fs_path(uri) or "unnamed.yaml")


def _cursor(params: AtPosition) -> Cursor | None:
    document = server.workspace.get_text_document(params.text_document.uri)
    try:
        text = document.source
    except (OSError, ValueError):  # not open in the editor, and no text on the disk
        return None
    return find_cursor(text, params.position.line, params.position.character)


def _range(line: int, start: int, end: int) -> types.Range:
    return types.Range(types.Position(line, start), types.Position(line, end))


def _diagnostic(mistake: Mistake) -> types.Diagnostic:
    return types.Diagnostic(
        _range(mistake.line, mistake.start, mistake.end),
        mistake.sentence,
        types.DiagnosticSeverity.Error,
        source="tactograph",
        data={"meant": mistake.meant},
    )
