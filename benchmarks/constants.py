"""Print the numbers that remain in the rooms that judge, each with its reason: `docs/constants.md`.

python benchmarks/constants.py [--write]
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "constants.md"
ROOMS = {
    "The trust in a touch": ("nodes/trust/*.py",),
    "Valid touches that are drawn": ("nodes/calibrate/ranks/*.py",),
    "Stated errors": ("nodes/error/*.py", "rings/*/nodes/**/doubt_*.py"),
    "Doubts of a calibration": (
        "nodes/**/judge_*.py",
        "nodes/calibrate/rating/pressed_ball.py",
        "rings/*/nodes/**/judge_*.py",
    ),
    "The fit of a film": (
        "nodes/calibrate/film/*.py",
        "nodes/calibrate/ball/balls_on_film.py",
        "nodes/calibrate/lights/light_samples.py",
        "rings/*/nodes/refit_film.py",
    ),
}
HEAD = """# Constants

Nearly all limits follow from physics, from the statistics of a sensor's own presses, or from
touches drawn from its calibration. This page lists the numbers that are set by hand in the rooms
that judge touches and calibrations, with their reasons. `python benchmarks/constants.py --write`
writes it from the code.
"""


COLUMNS = "| constant | value | reason |\n| --- | --- | --- |\n"


class Constant(NamedTuple):
    """Names, the value as it is written, how many numbers that holds, and the reason."""

    names: str
    value: str
    numbers: int
    reason: str


def constants(file: Path) -> Iterator[Constant]:
    """The constants of a file that hold numbers; the docstring right below one is its reason."""
    body = ast.parse(file.read_text()).body
    for place, statement in enumerate(body):
        if not isinstance(statement, ast.Assign | ast.AnnAssign) or statement.value is None:
            continue
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        named = [each.id for each in ast.walk(ast.Tuple(targets)) if isinstance(each, ast.Name)]
        held = [each for each in values(statement.value) if is_number(each)]
        if not held or not all(name.isupper() for name in named):
            continue
        text = docstring(body[place + 1]) if place + 1 < len(body) else ""
        value = " ".join(ast.unparse(statement.value).split())
        yield Constant(", ".join(named), value, len(held), " ".join(text.split()))


def values(node: ast.AST) -> Iterator[ast.AST]:
    """What an expression is made of; how an array is read backwards is no value of it."""
    yield node
    for part in ast.iter_child_nodes(node):
        if not isinstance(part, ast.Slice):
            yield from values(part)


def is_number(node: ast.AST) -> bool:
    number = isinstance(node, ast.Constant) and isinstance(node.value, int | float)
    return number and not isinstance(node.value, bool)


def docstring(statement: ast.stmt) -> str:
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
        return str(statement.value.value)
    return ""


def page() -> str:
    """The whole page."""
    parts, listed = [HEAD], set[Path]()
    for title, patterns in ROOMS.items():
        files = sorted({file for each in patterns for file in ROOT.glob(each)} - listed)
        listed |= {*files}
        rows = [(file, each) for file in files for each in constants(file)]
        count = sum(each.numbers for _, each in rows)
        parts.append(f"\n## {title}: {count}\n\n{COLUMNS}")
        for file, (names, value, _, reason) in rows:
            text = value if len(value) < 60 else f"{value[:57]}..."
            cells = (f"`{names}` in `{file.relative_to(ROOT)}`", f"`{text}`", reason)
            parts.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |\n")
    return "".join(parts)


if __name__ == "__main__":
    if "--write" in sys.argv:
        PAGE.write_text(page())
    else:
        print(page(), end="")
