"""The page of equations: code cites what it states, and it states what the code computes."""

import re
from pathlib import Path

import pytest

from tactograph.nodes.trust import _curl_check, _light_check, _line_check, _rest_check

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "model.md").read_text()
ROW = re.compile(r"^\| ((?:[A-Z]\d(?:, )?)+) \| .+", re.MULTILINE)
ROWS = [
    (found[1].split(", "), re.findall(r"`(\S+/\S+)`", found[0])) for found in ROW.finditer(PAGE)
]
CITED = re.compile(r"\b[Ee]quations? ([A-Z]\d)\b(?:(?:,| and| to) ([A-Z]\d)\b)*")
SOURCES = [
    path for part in ("nodes", "kernels", "rings") for path in sorted((ROOT / part).rglob("*.*"))
]

LIMITS = {
    "T1": (
        _light_check.MAX_MEDIAN, _light_check.MAX_QUARTILE, _light_check.MAX_REST,
        _light_check.MAX_SHADOW_LIGHT,
    ),
    "T2": (_curl_check.MAX_MEDIAN, _curl_check.MAX_QUARTILE, _curl_check.MAX_PART_SHARE),
    "T3": (
        _rest_check.MAX_LEVEL, _rest_check.MAX_KEPT_LEVEL, _rest_check.MAX_SPREAD,
        _rest_check.MAX_SHAPE, _rest_check.MAX_DARK_SHARE, _rest_check.MAX_DEPTH,
        _rest_check.MAX_TILT, _rest_check.MAX_ADDED,
    ),
    "T4": (_light_check.DIRTY_CELLS,),
    "T5": (_line_check.MAX_ROW_CHANGE,),
}  # fmt: skip
BLOCKS = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)
STATED = set(re.findall(r"^([A-Z]\d) ", "".join(BLOCKS), re.MULTILINE))
"""The labels of the equations: each begins a line of a text block."""


@pytest.mark.parametrize(("labels", "files"), ROWS, ids=[labels[0] for labels, _ in ROWS])
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


def test_what_code_cites_is_on_the_page() -> None:
    for path in SOURCES:
        if path.suffix in {".py", ".cl", ".clh"}:
            for found in CITED.finditer(path.read_text()):
                cited = {label for label in found.groups() if label}
                assert cited <= STATED, f"{path} cites equations {cited}"


@pytest.mark.parametrize("label", LIMITS)
def test_the_limits_of_the_checks_are_those_of_the_code(label: str) -> None:
    (block,) = (block for block in BLOCKS if block.startswith(label))
    for limit in LIMITS[label]:
        assert f"/ {limit:g}" in block, f"equation {label} lacks the limit {limit:g}"
