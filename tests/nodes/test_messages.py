"""A message names parameters and inputs of its own node, marked for the engine; no graph's.

A file of shared functions may name what one of the nodes that import it has.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from tactograph.graph.declare.find_node import find_node, node_places, shipped_nodes
from tactograph.graph.errors import MARKED_NAME
from tactograph.graph.rings import rings
from tactograph.nodes.capture.read_capture import CaptureFile
from tests.sources import tree

ASSIGNMENT = re.compile(r"(?<![\w.=$<`-])[a-z]\w*=(?!=)")
"""A value that is assigned to a name."""
NAME = re.compile(r"(?<![\w./'])[a-z]+(?:_[a-z]+)+(?![\w./'(])")
"""A name of several words."""
COMMAND = re.compile(r"tactograph run [^)';]*")
"""A command of a shipped graph, whose params are part of it."""
ENTRY = re.compile("|".join(CaptureFile.model_fields))
"""A name in a capture's own file, as that spells it."""


def test_messages_name_no_params_of_graphs() -> None:
    assert [*_of_graphs()] == []


def test_marks_are_of_the_node_or_of_one_that_imports_the_file() -> None:
    assert [*_foreign_marks()] == []


def test_both_checks_find_a_violation() -> None:
    source = 'raise InputError(f"{x}: give `mm`=MM, or lens=FILE and pixel_size_mm")'
    (text,) = _sentences(ast.parse(source))
    assert ASSIGNMENT.findall(_bare(text)) == ["lens="]
    assert NAME.findall(_bare(text)) == ["pixel_size_mm"]
    assert MARKED_NAME.findall(text) == [("mm", "=MM")]


def _of_graphs() -> Iterator[str]:
    """The messages that name a setting without a mark."""
    settings = {name for node in shipped_nodes() for name in find_node(node).parameters}
    for file in _files():
        for text in _texts(file):
            bare = _bare(text)
            if "capture.yaml" in text:
                bare = ENTRY.sub("", bare)
            for name in [*ASSIGNMENT.findall(bare), *sorted({*NAME.findall(bare)} & settings)]:
                yield f"{file}: {name}: {text}"


def _foreign_marks() -> Iterator[str]:
    nodes_of = {_file(name): [name] for name in shipped_nodes()}
    imported = {name: _imported(file) for file, (name,) in nodes_of.items()}
    for file in _files():
        nodes = nodes_of.get(file) or [n for n, files in imported.items() if file in files]
        known = {
            name for node in map(find_node, nodes) for name in (*node.parameters, *node.inputs)
        }
        for text in _texts(file):
            for name, _ in MARKED_NAME.findall(text):
                if name not in known:
                    yield f"{file}: {name}: {text}"


def _files() -> list[Path]:
    shipped = [ring for ring in rings() if ring.shipped]
    return [file for ring in shipped for file in ring.files("nodes", "[!_]*/**/*.py")]


def _sentences(source: ast.AST) -> Iterator[str]:
    """The texts of a file that may be messages: of several words, no docstrings, no pages."""
    nodes = [*ast.walk(source)]
    inner = {node.value for node in nodes if isinstance(node, ast.Expr)}
    inner |= {part for n in nodes if isinstance(n, ast.JoinedStr) for part in n.values}
    for node in nodes:
        parts = node.values if isinstance(node, ast.JoinedStr) else [node]
        texts = [str(p.value) if isinstance(p, ast.Constant) else "{}" for p in parts]
        is_text = isinstance(node, ast.JoinedStr) or (
            isinstance(node, ast.Constant) and isinstance(node.value, str)
        )
        if is_text and node not in inner and " " in "".join(texts) and texts[0][:1] != "<":
            yield "".join(texts)


@cache
def _texts(file: Path) -> list[str]:
    return [*_sentences(tree(file))]


def _bare(text: str) -> str:
    return COMMAND.sub("", MARKED_NAME.sub("", text))


def _file(node: str) -> Path:
    return _source(node_places()[node].module) or Path()


@cache
def _source(module: str) -> Path | None:
    """The file of a module of the package; None for other names."""
    try:
        spec = find_spec(module)
    except ModuleNotFoundError:
        return None
    return None if spec is None or spec.origin is None else Path(spec.origin)


def _imported(own: Path) -> set[Path]:
    """The file of a node, those that it imports, and those that they import."""
    files, waiting = set[Path](), [own]
    while waiting:
        file = waiting.pop()
        if file in files:
            continue
        files.add(file)
        waiting += _imports(file)
    return files


@cache
def _imports(file: Path) -> list[Path]:
    """The files of the package that a file imports."""
    imports = (each for each in ast.walk(tree(file)) if isinstance(each, ast.ImportFrom))
    modules = [(str(each.module), each.names) for each in imports]
    names = [
        name
        for module, parts in modules
        if module.startswith("tactograph.")
        for name in (module, *(f"{module}.{part.name}" for part in parts))
    ]
    return [source for name in names if (source := _source(name))]
