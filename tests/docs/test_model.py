"""The page of equations: code cites its equations, and it states those that code computes."""

import re
from pathlib import Path

import pytest

from tests.fixtures import needs_rings

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "model.md").read_text()
ROW = re.compile(r"^\| ((?:[A-Z]\d(?:, )?)+) \| .+", re.MULTILINE)
ROWS = [
    (match[1].split(", "), re.findall(r"`(\S+/\S+)`", match[0])) for match in ROW.finditer(PAGE)
]
CITED = re.compile(r"\b[Ee]quations? ([A-Z]\d)\b(?:(?:,| and| to) ([A-Z]\d)\b)*")
SOURCES = [
    path for part in ("nodes", "kernels", "rings") for path in sorted((ROOT / part).rglob("*.*"))
]

BLOCKS = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)
STATED = set(re.findall(r"^([A-Z]\d) ", "".join(BLOCKS), re.MULTILINE))
"""The labels of the equations: each begins a line of a text block."""


@pytest.mark.parametrize(
    ("labels", "files"),
    [pytest.param(*row, marks=needs_rings if "rings/" in "".join(row[1]) else []) for row in ROWS],
    ids=[labels[0] for labels, _ in ROWS],
)
def test_the_files_that_hold_an_equation_cite_it(labels: list[str], files: list[str]) -> None:
    assert files
    for label in labels:
        assert label in STATED, f"the page has no equation {label}"
        for name in files:
            text = (ROOT / name).read_text()
            number = int(label[1])
            spans = re.findall(rf"\b{label[0]}(\d) to {label[0]}(\d)\b", text)
            inside = any(int(first) <= number <= int(last) for first, last in spans)
            assert inside or re.search(rf"\b{label}\b", text), f"{name} does not cite {label}"


def test_the_table_names_every_equation_of_the_page() -> None:
    assert {label for labels, _ in ROWS for label in labels} == STATED


def test_equations_that_code_cites_are_on_the_page() -> None:
    for path in SOURCES:
        if path.suffix in {".py", ".cl", ".clh"}:
            for match in CITED.finditer(path.read_text()):
                cited = {label for label in match.groups() if label}
                assert cited <= STATED, f"{path} cites equations {cited}"
