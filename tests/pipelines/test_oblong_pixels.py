"""Cameras whose pixels are not square, such as of 11.7 by 10.8 px/mm."""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.pipelines.matt_film import (
    PIXEL_MM,
    TOUCH,
    calibrated,
    run,
    see,
    warnings_of,
)

ROWS = 111
LENGTH_MM = PIXEL_MM * 120 / ROWS


def squeezed(planes: np.ndarray) -> np.ndarray:
    return np.stack([cv2.resize(p, (160, ROWS), interpolation=cv2.INTER_AREA) for p in planes])


def oblong_percent(lines: list[str]) -> float:
    """How much longer than wide pixels are, as stated by a calibration."""
    (match,) = filter(None, (re.search(r"them ([\d.]+)% longer than wide", line) for line in lines))
    return float(match[1])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with captures and a calibration."""
    captures = tmp_path_factory.mktemp("oblong")
    see(captures, squeezed)
    assert not warnings_of(calibrated(captures, (PIXEL_MM, LENGTH_MM), ranked=False))
    return captures


@pytest.mark.one_case
@pytest.mark.parametrize("graph", ["reconstruct", "precise", "paper"])
def test_heights_equal_those_of_square_pixels_and_state_both_sides_of_a_pixel(
    folder: Path, graph: str
) -> None:
    params = {"capture": str(folder / "touch"), "calibration": str(folder / "cal.npz")}
    result = run(graph, **params, out=str(folder / graph))
    off = result["height"] - squeezed(TOUCH[None])[0]
    assert np.sqrt(np.mean(off**2)) < (0.03 if graph == "paper" else 0.012)
    if graph != "paper":
        major, minor = (result["metrics"][f"contact_{axis}_mm/c1"] for axis in ("major", "minor"))
        assert major == pytest.approx(minor, rel=0.02)
    about = json.loads((folder / graph / "result.json").read_text())
    assert about["pixel_sides_mm"] == pytest.approx([PIXEL_MM, LENGTH_MM], rel=1e-5)


@pytest.mark.slow
def test_an_oblong_ball_gives_a_warning(folder: Path) -> None:
    result = calibrated(folder, out="square.npz")
    assert oblong_percent(warnings_of(result)) == pytest.approx(
        100 * (LENGTH_MM / PIXEL_MM - 1), abs=0.5
    )
