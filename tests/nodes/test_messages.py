"""A message names parameters and inputs of its own node, marked for the engine; no graph's."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tactograph.graph.declare.find_node import builtin_rooms, find_node
from tactograph.graph.errors import MARKED_NAME
from tactograph.nodes.capture.read_capture import CaptureFile

NODES = Path(__file__).parents[2] / "nodes"
GIVEN = re.compile(r"(?<![\w.=$<`-])[a-z]\w*=(?!=)")
"""A value that is given to a name."""
NAME = re.compile(r"(?<![\w./'])[a-z]+(?:_[a-z]+)+(?![\w./'(])")
"""A name of several words."""
COMMAND = re.compile(r"tactograph run [^)';]*")
"""A command of a shipped graph, whose params are part of it."""


def test_messages_know_nodes_and_no_graph() -> None:
    assert [*_of_graphs()] == []


def test_marks_are_of_the_node_or_of_one_that_uses_the_file() -> None:
    assert [*_foreign_marks()] == []


def test_the_test_finds_both() -> None:
    source = 'raise InputError(f"{x}: give `mm`=MM, or lens=FILE and pixel_size_mm")'
    (text,) = _messages(ast.parse(source))
    assert GIVEN.findall(_bare(text)) == ["lens="]
    assert NAME.findall(_bare(text)) == ["pixel_size_mm"]
    assert MARKED_NAME.findall(text) == [("mm", "=MM")]


def _of_graphs() -> Iterator[str]:
    """The messages that name a setting without a mark."""
    of_files = {*CaptureFile.model_fields}
    for file in sorted(NODES.rglob("*.py")):
        for text in filter(_is_sentence, _messages(_tree(file))):
            named = set(NAME.findall(_bare(text))) & _settings()
            for name in [*GIVEN.findall(_bare(text)), *sorted(named - of_files)]:
                yield f"{file.relative_to(NODES)}: {name}: {text}"


def _foreign_marks() -> Iterator[str]:
    used = {name: _imported(_file(name)) for name in builtin_rooms()}
    for file in sorted(NODES.rglob("[!_]*/**/*.py")):
        users = (
            [file.stem] if file.stem in used else [n for n, all_ in used.items() if file in all_]
        )
        known = {name for user in users for name in _names(user)}
        for text in _messages(_tree(file)):
            for name, _ in MARKED_NAME.findall(text):
                if name not in known:
                    yield f"{file.relative_to(NODES)}: {name}: {text}"


def _messages(tree: ast.AST) -> Iterator[str]:
    """The texts of a file that may be part of a message: all but docstrings and annotations."""
    documents = {node.value for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    parts = {
        part for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values
    }
    for node in ast.walk(tree):
        if node in documents or node in parts:
            continue
        if isinstance(node, ast.JoinedStr):
            yield "".join(
                str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values
            )
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def _is_sentence(text: str) -> bool:
    return " " in text


def _bare(text: str) -> str:
    return COMMAND.sub("", MARKED_NAME.sub("", text))


@cache
def _tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


def _file(name: str) -> Path:
    return NODES / builtin_rooms()[name] / f"{name}.py"


def _names(name: str) -> set[str]:
    node = find_node(name)
    return {*node.parameters, *node.inputs}


@cache
def _settings() -> set[str]:
    return {name for node in builtin_rooms() for name in find_node(node).parameters}


def _imported(file: Path) -> set[Path]:
    """The node files that a file imports, and those that they import."""
    found, waiting = set[Path](), [file]
    while waiting:
        for node in ast.walk(_tree(waiting.pop())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(
                "tactograph.nodes"
            ):
                parts = (node.module or "").split(".")[2:]
                named = [NODES.joinpath(*parts).with_suffix(".py")] if parts else []
                named += [NODES.joinpath(*parts, f"{each.name}.py") for each in node.names]
                waiting += [each for each in named if each.is_file() and each not in found]
                found.update(each for each in named if each.is_file())
    return found
