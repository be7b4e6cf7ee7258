"""Wrong inputs are reported: the benchmark of silent errors at a small size."""

import csv
from pathlib import Path

import pytest

from tests.fixtures import ROOT, python

REPORTED = (
    "swapped_neighbours", "order_rotated", "mirrored", "led_twice", "interlaced", "another_sensor",
)  # fmt: skip
"""Kinds of mistakes that every touch under near LEDs reveals."""
UNREPORTED = ("wave", "radius")
Row = dict[str, str]


@pytest.fixture(scope="module")
def rows(once: Path) -> list[Row]:
    """The rows of some kinds on a sensor with near LEDs."""
    script, table = ROOT / "benchmarks" / "silent.py", once / "silent.csv"
    kinds = ["--kind", "valid", *REPORTED, *UNREPORTED]
    files = ["--csv", str(table), "--cache", str(once / "silent")]
    python(script, "--small", *kinds, *files)
    with table.open(newline="") as file:
        return list(csv.DictReader(file))


def of(rows: list[Row], *kinds: str) -> list[Row]:
    return [row for row in rows if row["kind"] in kinds]


@pytest.mark.slow
def test_valid_touches_give_the_height(rows: list[Row]) -> None:
    valid = of(rows, "valid")
    assert len(valid) == 13
    assert [row["touch"] for row in valid if float(row["rmse_um"]) > 20] == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", REPORTED)
def test_a_wrong_input_is_reported(rows: list[Row], kind: str) -> None:
    wrong = of(rows, kind)
    assert wrong
    assert all(row["harm"] == "True" and row["reported"] == "True" for row in wrong)


@pytest.mark.slow
@pytest.mark.parametrize("kind", UNREPORTED)
def test_other_wrong_inputs_do_harm(rows: list[Row], kind: str) -> None:
    assert any(row["harm"] == "True" for row in of(rows, kind))


@pytest.mark.slow
def test_a_wrong_radius_is_reported_at_calibration(rows: list[Row]) -> None:
    reported = [
        row["reported_at_calibration"] for row in of(rows, "radius") if float(row["value"]) > 1.05
    ]
    assert reported == ["True", "True"]
