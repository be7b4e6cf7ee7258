"""Rooms of the nodes: their size and names, and what belongs to one of them alone.

The length of files and the names of constants, those of the engine too.
"""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import networkx as nx
import pytest

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


def product(house: str) -> Iterator[Path]:
    """The Python files of a top-level folder, without tests and what runs on a microcontroller."""
    other = {"tests", "firmware"}
    return (file for file in (ROOT / house).rglob("*.py") if not other & {*file.parts})


def taken() -> Iterator[tuple[Path, str, str]]:
    """Each file of a room, the module that it imports from, and the name that it takes."""
    for file in (ROOT / "nodes").rglob("*.py"):
        for statement in ast.walk(ast.parse(file.read_text())):
            if isinstance(statement, ast.ImportFrom) and statement.module:
                for name in statement.names:
                    yield file.relative_to(ROOT), statement.module, name.name


def module_of(file: Path) -> str:
    return ".".join(("tactograph", *file.with_suffix("").parts)).removesuffix(".__init__")


def room_of(module: str) -> Path:
    return Path(*module.split(".")[1:-1])


def test_a_file_of_one_room_is_read_by_no_other() -> None:
    found = {(file, module) for file, module, _ in taken() if f"{PACKAGE}." in module}
    own = [(file, module) for file, module in found if module.split(".")[-1].startswith("_")]
    assert own
    assert [each for each in own if room_of(each[1]) != each[0].parent] == []


def test_a_name_of_one_file_is_taken_by_no_other() -> None:
    assert [each for each in taken() if each[2].startswith("_")] == []


@pytest.mark.parametrize("house", ["graph", "nodes", "rings"])
def test_a_room_can_be_overlooked(house: str) -> None:
    for room in {file.parent for file in product(house)}:
        files = [*room.glob("*.py")]
        lines = sum(len(file.read_text().splitlines()) for file in files)
        assert len(files) <= MAX_FILES, room
        assert lines <= MAX_LINES, room


@pytest.mark.parametrize("house", ["nodes", "kernels"])
def test_a_name_stands_for_one_file(house: str) -> None:
    names = Counter(file.name for file in (ROOT / house).rglob("[!_]*.*"))
    assert [name for name, times in names.items() if times > 1] == []


def test_kernels_have_the_rooms_of_their_nodes() -> None:
    kernels = {file.relative_to(ROOT / "kernels") for file in (ROOT / "kernels").rglob("*.cl")}
    nodes = {file.relative_to(ROOT / "nodes") for file in (ROOT / "nodes").rglob("*.py")}
    assert {kernel.with_suffix(".py") for kernel in kernels} <= nodes


def says_why(file: Path) -> bool:
    return "Long because" in (ast.get_docstring(ast.parse(file.read_text())) or "")


@pytest.mark.parametrize("folder", ["graph", "nodes", "rings"])
def test_a_long_file_says_why(folder: str) -> None:
    for file in product(folder):
        assert len(file.read_text().splitlines()) <= MAX_FILE_LINES or says_why(file), file


def code_lines(file: Path) -> int:
    """The lines of a file without docstrings, comments and blank lines."""
    text = file.read_text()
    told = {
        line
        for each in ast.walk(ast.parse(text))
        if isinstance(each, ast.Expr) and isinstance(each.value, ast.Constant)
        for line in range(each.lineno, (each.end_lineno or each.lineno) + 1)
    }
    lines = enumerate(map(str.strip, text.splitlines()), start=1)
    return sum(number not in told and line[:1] not in ("", "#") for number, line in lines)


def test_a_long_node_says_why() -> None:
    """With what it alone uses: modules to which every way of imports from a node leads by it."""
    files = {module_of(file.relative_to(ROOT)): file for file in (ROOT / "nodes").rglob("*.py")}
    nodes = {module for module, file in files.items() if "\n@node" in file.read_text()}
    imports = nx.DiGraph(("", node) for node in nodes)
    for file, module, name in taken():
        imports.add_edges_from((module_of(file), each) for each in (module, f"{module}.{name}"))
    ways, lines = nx.immediate_dominators(imports, ""), Counter[str]()
    for module in files.keys() & ways.keys():
        owner = module
        while ways[owner]:
            owner = ways[owner]
        lines[owner] += code_lines(files[module])
    long = {node for node in nodes if lines[node] > MAX_NODE_LINES}
    assert long
    assert [node for node in long if not says_why(files[node])] == []


def test_a_constant_is_named_by_noun_and_unit() -> None:
    for file in (file for house in ("graph", "nodes", "rings") for file in product(house)):
        for statement in ast.parse(file.read_text()).body:
            if not isinstance(statement, ast.Assign | ast.AnnAssign):
                continue
            made = [each for each in ast.walk(statement) if isinstance(each, ast.Name)]
            names = {each.id.lstrip("_") for each in made if isinstance(each.ctx, ast.Store)}
            words = {name for name in names if re.fullmatch(r"[A-Z][A-Z\d]*", name)}
            assert {word for word in words if not TYPE_NAME.fullmatch(word)} <= PLAIN_NAMES, file
