"""Rooms of the nodes: their size and names, and what belongs to one of them alone."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = "tactograph.nodes"
MAX_FILES, MAX_LINES = 25, 3000


def taken() -> Iterator[tuple[Path, str, str]]:
    """Each file of a room, the module that it imports from, and the name that it takes."""
    for file in (ROOT / "nodes").rglob("*.py"):
        for statement in ast.walk(ast.parse(file.read_text())):
            if isinstance(statement, ast.ImportFrom) and statement.module:
                for name in statement.names:
                    yield file.relative_to(ROOT), statement.module, name.name


def room_of(module: str) -> Path:
    return Path(*module.split(".")[1:-1])


def test_a_file_of_one_room_is_read_by_no_other() -> None:
    found = {(file, module) for file, module, _ in taken() if f"{PACKAGE}." in module}
    own = [(file, module) for file, module in found if module.split(".")[-1].startswith("_")]
    assert own
    assert [each for each in own if room_of(each[1]) != each[0].parent] == []


def test_a_name_of_one_file_is_taken_by_no_other() -> None:
    assert [each for each in taken() if each[2].startswith("_")] == []


def test_a_room_can_be_overlooked() -> None:
    for room in {file.parent for file in (ROOT / "nodes").rglob("*.py")}:
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
