"""What begins with an underscore belongs to one room, or one file, alone."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = "tactograph.nodes"


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
