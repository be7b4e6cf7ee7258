"""Rooms of the nodes: their size and names, and files that belong to one room alone.

The length of files and the names of constants are checked in the engine too.
"""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import networkx as nx
import pytest

from tests.sources import tree

ROOT = Path(__file__).parents[2]
PACKAGE = "tactograph.nodes"
MAX_FILES, MAX_LINES = 25, 3000
MAX_FILE_LINES, MAX_NODE_LINES = 400, 150
TYPE_NAME = re.compile(r"[A-Z]\d|[TR]")
PLAIN_NAMES = {
    *("BACKENDS", "COMMANDS", "PENDING", "DONE", "FAILED", "EVERYTHING"),
    *("ORANGE", "BLUE", "GREY", "DPI", "LOGGER", "KIND", "GRAPH", "OVERLAY"),
}
"""Constants that have no unit: choices, states, colours."""


def product(folder: str) -> Iterator[Path]:
    """The Python files of a top-level folder, without tests and firmware."""
    other = {"tests", "firmware"}
    return (file for file in (ROOT / folder).rglob("*.py") if not other & {*file.parts})


@cache
def imported_names() -> list[tuple[Path, str, str]]:
    """Each file of a room, the module that it imports from, and the imported name."""
    return [
        (file.relative_to(ROOT), statement.module, name.name)
        for file in (ROOT / "nodes").rglob("*.py")
        for statement in ast.walk(tree(file))
        if isinstance(statement, ast.ImportFrom) and statement.module
        for name in statement.names
    ]


def module_of(file: Path) -> str:
    return ".".join(("tactograph", *file.with_suffix("").parts)).removesuffix(".__init__")


def room_of(module: str) -> Path:
    return Path(*module.split(".")[1:-1])


def test_a_private_file_is_imported_in_its_room_alone() -> None:
    pairs = {(file, module) for file, module, _ in imported_names() if f"{PACKAGE}." in module}
    private = [(file, module) for file, module in pairs if module.split(".")[-1].startswith("_")]
    assert private
    assert [each for each in private if room_of(each[1]) != each[0].parent] == []


def test_a_private_name_is_imported_by_no_other_file() -> None:
    assert [each for each in imported_names() if each[2].startswith("_")] == []


@pytest.mark.parametrize("folder", ["graph", "nodes", "rings"])
def test_a_room_is_small(folder: str) -> None:
    for room in {file.parent for file in product(folder)}:
        files = [*room.glob("*.py")]
        lines = sum(len(file.read_text().splitlines()) for file in files)
        assert len(files) <= MAX_FILES, room
        assert lines <= MAX_LINES, room


@pytest.mark.parametrize("folder", ["nodes", "kernels"])
def test_a_name_stands_for_one_file(folder: str) -> None:
    names = Counter(file.name for file in (ROOT / folder).rglob("[!_]*.*"))
    assert [name for name, times in names.items() if times > 1] == []


def test_kernels_have_the_rooms_of_their_nodes() -> None:
    kernels = {file.relative_to(ROOT / "kernels") for file in (ROOT / "kernels").rglob("*.cl")}
    nodes = {file.relative_to(ROOT / "nodes") for file in (ROOT / "nodes").rglob("*.py")}
    assert {kernel.with_suffix(".py") for kernel in kernels} <= nodes


def states_reason(file: Path) -> bool:
    return "Long because" in (ast.get_docstring(tree(file)) or "")


@pytest.mark.parametrize("folder", ["graph", "nodes", "rings"])
def test_a_long_file_states_its_reason(folder: str) -> None:
    for file in product(folder):
        assert len(file.read_text().splitlines()) <= MAX_FILE_LINES or states_reason(file), file


def code_lines(file: Path) -> int:
    """The lines of a file without docstrings, comments and blank lines."""
    text = file.read_text()
    docstrings = {
        line
        for each in ast.walk(tree(file))
        if isinstance(each, ast.Expr) and isinstance(each.value, ast.Constant)
        for line in range(each.lineno, (each.end_lineno or each.lineno) + 1)
    }
    lines = enumerate(map(str.strip, text.splitlines()), start=1)
    return sum(number not in docstrings and line[:1] not in ("", "#") for number, line in lines)


def test_a_long_node_states_its_reason() -> None:
    """With the modules that it alone uses: all chains of imports to them lead through it."""
    files = {module_of(file.relative_to(ROOT)): file for file in (ROOT / "nodes").rglob("*.py")}
    nodes = {module for module, file in files.items() if "\n@node" in file.read_text()}
    imports = nx.DiGraph(("", node) for node in nodes)
    for file, module, name in imported_names():
        imports.add_edges_from((module_of(file), each) for each in (module, f"{module}.{name}"))
    dominators, lines = nx.immediate_dominators(imports, ""), Counter[str]()
    for module in files.keys() & dominators.keys():
        owner = module
        while dominators[owner]:
            owner = dominators[owner]
        lines[owner] += code_lines(files[module])
    long = {node for node in nodes if lines[node] > MAX_NODE_LINES}
    assert long
    assert [node for node in long if not states_reason(files[node])] == []


def test_a_constant_is_named_by_noun_and_unit() -> None:
    for file in (file for folder in ("graph", "nodes", "rings") for file in product(folder)):
        for statement in tree(file).body:
            if not isinstance(statement, ast.Assign | ast.AnnAssign):
                continue
            targets = [each for each in ast.walk(statement) if isinstance(each, ast.Name)]
            names = {each.id.lstrip("_") for each in targets if isinstance(each.ctx, ast.Store)}
            words = {name for name in names if re.fullmatch(r"[A-Z][A-Z\d]*", name)}
            assert {word for word in words if not TYPE_NAME.fullmatch(word)} <= PLAIN_NAMES, file
