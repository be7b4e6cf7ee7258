"""`tactograph lsp` as an editor meets it: a client that starts it and talks to it over stdio."""

import asyncio
import sys
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path

import pytest
from lsprotocol import types
from pygls.lsp.client import LanguageClient

from tactograph.rings.editor.language.complete import offers_at
from tactograph.rings.editor.language.cursor import find_cursor
from tactograph.rings.editor.language.explain import definition_at, words_at

HEAD = "format: 1\nextends: reconstruct\ntitle: mine\npatch:\n"
WAIT_S = 60.0


class Editor:
    """A client with one open file; a `|` in a text is the cursor."""

    def __init__(self, file: Path) -> None:
        self.file, self.uri, self.version = file, file.as_uri(), 0
        self.client = LanguageClient("test", "1")
        self.published: asyncio.Queue[types.PublishDiagnosticsParams] = asyncio.Queue()
        self.client.feature(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)(
            lambda params: self.published.put_nowait(params)
        )

    async def __aenter__(self) -> "Editor":
        await self.client.start_io(sys.executable, "-m", "tactograph", "lsp")
        folder = types.WorkspaceFolder(self.file.parent.as_uri(), "work")
        can = types.ClientCapabilities()
        await self.client.initialize_async(
            types.InitializeParams(can, workspace_folders=[folder], root_uri=folder.uri)
        )
        self.client.initialized(types.InitializedParams())
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.client.shutdown_async(None)
        self.client.exit(None)
        await self.client.stop()

    def type(self, text: str) -> types.TextDocumentPositionParams:
        """Open the file, or change it, to a text; the place of its cursor."""
        before, _, after = text.partition("|")
        whole, self.version = before + after, self.version + 1
        if self.version == 1:
            item = types.TextDocumentItem(self.uri, "yaml", 1, whole)
            self.client.text_document_did_open(types.DidOpenTextDocumentParams(item))
        else:
            now = types.VersionedTextDocumentIdentifier(self.version, self.uri)
            change = [types.TextDocumentContentChangeWholeDocument(whole)]
            self.client.text_document_did_change(types.DidChangeTextDocumentParams(now, change))
        lines = before.split("\n")
        place = types.Position(len(lines) - 1, len(lines[-1]))
        return types.TextDocumentPositionParams(self.document, place)

    @property
    def document(self) -> types.TextDocumentIdentifier:
        return types.TextDocumentIdentifier(self.uri)

    async def offers(self, text: str) -> dict[str, types.CompletionItem]:
        at = self.type(text)
        params = types.CompletionParams(at.text_document, at.position)
        found = await self.client.text_document_completion_async(params)
        assert isinstance(found, list)
        return {item.label: item for item in found}

    async def hover(self, text: str) -> str:
        at = self.type(text)
        params = types.HoverParams(at.text_document, at.position)
        found = await self.client.text_document_hover_async(params)
        assert found is not None
        assert isinstance(found.contents, types.MarkupContent)
        return found.contents.value

    async def definition(self, text: str) -> tuple[str, str]:
        """The name of the file, and the line."""
        at = self.type(text)
        params = types.DefinitionParams(at.text_document, at.position)
        found = await self.client.text_document_definition_async(params)
        assert isinstance(found, types.Location)
        file = Path(found.uri.removeprefix("file://"))
        return file.name, file.read_text().splitlines()[found.range.start.line].strip()

    async def mistakes(self, text: str) -> list[types.Diagnostic]:
        self.type(text)
        while True:
            params = await asyncio.wait_for(self.published.get(), WAIT_S)
            if params.version == self.version:
                return [*params.diagnostics]

    async def mends(self, mistake: types.Diagnostic) -> list[types.TextEdit]:
        context = types.CodeActionContext([mistake])
        params = types.CodeActionParams(self.document, mistake.range, context)
        found = await self.client.text_document_code_action_async(params)
        return [e.edit.changes[self.uri][0] for e in found or [] if e.edit and e.edit.changes]  # type: ignore[union-attr]


Talk = Callable[[Editor], Awaitable[None]]


@pytest.fixture(scope="module")
def talk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[Talk], None]]:
    """Run a talk with a server, whose start takes longer than a talk."""
    editor = Editor(tmp_path_factory.mktemp("work") / "mine.yaml")
    with asyncio.Runner() as loop:
        loop.run(editor.__aenter__())
        yield lambda each: loop.run(asyncio.wait_for(each(editor), 2 * WAIT_S))
        loop.run(editor.__aexit__())


def test_a_patch_is_completed_by_the_graph_that_it_changes(talk: Callable[[Talk], None]) -> None:
    async def typed(editor: Editor) -> None:
        offers = await editor.offers(HEAD + "  - {set: lab|}\n")
        assert {"label", "rough", "rough_pass.matt"} <= {*offers}
        edit = offers["label"].text_edit
        assert isinstance(edit, types.TextEdit)
        assert edit.range.end.character - edit.range.start.character == len("lab")
        params = await editor.offers(HEAD + "  - {set: label, with: {ste|")
        assert "above 0" in str(params["steepest"].documentation)
        below = await editor.offers(HEAD + "  - set: label\n    with:\n      ste|\n")
        assert {*below} == {*params}
        assert "price" in below
        inputs = await editor.offers(HEAD + "  - {set: label, in: {|}}\n")
        assert "K x H x W [1]" in str(inputs["light"].documentation)
        ports = await editor.offers(HEAD + "  - {set: label, in: {light: matt.|}}\n")
        assert {"matt.light", "matt.sigma"} <= {*ports}
        of_use = await editor.offers(HEAD + "  - {insert: more, group: take, with: {|}}\n")
        assert "capture" in of_use
        values = await editor.offers(
            HEAD + "  - {insert: a, op: preview, in: {touch: touch}, with: {where: |}}\n"
        )
        assert {"window", "files", "$calibration"} <= {*values}

    talk(typed)


def test_nodes_of_a_group_see_its_inputs_and_one_another(talk: Callable[[Talk], None]) -> None:
    async def typed(editor: Editor) -> None:
        offers = await editor.offers(
            "format: 1\ninputs: {height: {}}\nparams: {mm: {help: its side}}\nnodes:\n"
            "  size: {op: pixel_size}\n  raw: {op: integrate_dct, in: {slope: |}}\n"
        )
        assert {"height", "size"} <= {*offers}

    talk(typed)


def test_words_are_explained_and_found(talk: Callable[[Talk], None]) -> None:
    async def read(editor: Editor) -> None:
        assert "(default 30.0, above 0)" in await editor.hover(
            HEAD + "  - {set: label, with: {steep|est: 4}}\n"
        )
        assert (await editor.hover(HEAD + "  - {insert: a, op: coar|sen}\n")).startswith(
            "# coarsen"
        )
        name = await editor.definition(HEAD + "  - {set: lab|el, with: {steepest: 4}}\n")
        assert name == ("reconstruct.yaml", "label:")
        inner = await editor.definition(HEAD + "  - {set: a, in: {b: departu|re}}\n")
        assert inner[0] == "judge.group.yaml"
        assert inner[1].startswith("departure:")
        assert (await editor.definition("format: 1\nextends: prec|ise\n"))[0] == "precise.yaml"
        group = await editor.definition(HEAD + "  - {insert: a, group: ta|ke}\n")
        assert group[0] == "take.group.yaml"
        code = await editor.definition(HEAD + "  - {insert: a, op: coar|sen}\n")
        assert code[0] == "coarsen.py"

    talk(read)


def test_a_file_that_is_not_there_has_no_words(talk: Callable[[Talk], None]) -> None:
    async def about(editor: Editor) -> None:
        nowhere = types.Position(0, 0)
        params = types.HoverParams(types.TextDocumentIdentifier(f"{editor.uri}.not"), nowhere)
        assert await editor.client.text_document_hover_async(params) is None

    talk(about)


@pytest.mark.parametrize(
    "text",
    [
        "format: 1\ninputs: {}\nnodes: soon\nparams: {a: |}\n",
        "format: 1\ninputs: none\nparams: soon\noutputs: 3\nnodes: {a: {op: |}}\n",
        "format: 1\ninputs: {}\nparams: {a: soon}\nnodes: {b: soon, c: {in: {|}}}\n",
        "format: 1\ngroups: {g: soon}\nnodes: {u: {group: g, with: {|}}}\n",
        "format: 1\ngroups: soon\nnodes: {u: {group: |}}\n",
        "format: 1\ngroups: {g: {nodes: [|]}}\n",
        "format: 1\ngroups: {g: [{in: |}]}\n",
    ],
)
def test_a_text_of_another_shape_is_no_failure(text: str, tmp_path: Path) -> None:
    before, _, after = text.partition("|")
    lines = before.split("\n")
    cursor = find_cursor(before + after, len(lines) - 1, len(lines[-1]))
    assert cursor is not None
    for answer in (offers_at, words_at, definition_at):
        answer(cursor, tmp_path / "mine.yaml", None)


def test_mistakes_are_shown_while_typing_and_mended(talk: Callable[[Talk], None]) -> None:
    async def mistaken(editor: Editor) -> None:
        text = HEAD + "  - {set: label, with: {steepst: 4}}\n  - {set: level, with: {cel: 2}}\n"
        found = await editor.mistakes(text)
        assert [each.range.start.line for each in found] == [4, 5]
        assert "no parameter 'steepst'; did you mean 'steepest'?" in found[0].message
        (edit,) = await editor.mends(found[0])
        assert edit.new_text == "steepest"
        line, (start, end) = text.splitlines()[4], (edit.range.start, edit.range.end)
        assert line[start.character : end.character] == "steepst"
        (torn,) = await editor.mistakes(HEAD + "  - {set: label, with {\n")
        assert torn.range.start.line >= 4
        assert await editor.mistakes(HEAD + "  - {set: label, with: {steepest: 4}}\n") == []
        assert await editor.mistakes("pixel_size_mm: 0.1\nleds: [1, 2\n") == []
        variant = "variants:\n  a: {patch: [{remove: labl}]}\n"
        (of_variant,) = await editor.mistakes(f"{HEAD}  - {{neutral: departure}}\n{variant}")
        assert "there is no node 'labl'" in of_variant.message

    talk(mistaken)
