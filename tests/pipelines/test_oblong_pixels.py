"""Cameras whose pixels are not square, such as of 11.7 by 10.8 px/mm."""

import json
from itertools import product
from pathlib import Path

import cv2
import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes.simulate.shape_ball import shape_ball
from tactograph.nodes.write.read_pixel_size import read_pixel_size
from tests.pipelines.matt_film import (
    BALL_MM,
    CANVAS,
    FLAT,
    PIXEL_MM,
    TOUCH,
    calibrated,
    leds,
    run,
    said,
    see,
    taken,
)

ROWS = 111
LENGTH_MM = PIXEL_MM * 120 / ROWS


def squeezed(planes: np.ndarray) -> np.ndarray:
    return np.stack([cv2.resize(p, (160, ROWS), interpolation=cv2.INTER_AREA) for p in planes])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with captures and a calibration."""
    made = tmp_path_factory.mktemp("oblong")
    see(made, squeezed)
    assert not said(calibrated(made, (PIXEL_MM, LENGTH_MM)))
    return made


@pytest.mark.one_case
@pytest.mark.parametrize("graph", ["reconstruct", "precise", "paper"])
def test_heights_are_as_of_square_pixels_but_have_no_pixel_size(folder: Path, graph: str) -> None:
    given = {"capture": str(folder / "touch"), "calibration": str(folder / "cal.npz")}
    result = run(graph, **given, out=str(folder / graph))
    off = result["height"] - squeezed(TOUCH[None])[0]
    assert np.sqrt(np.mean(off**2)) < (0.03 if graph == "paper" else 0.012)
    if graph != "paper":
        major, minor = (result["metrics"][f"contact_{axis}_mm/c1"] for axis in ("major", "minor"))
        assert major == pytest.approx(minor, rel=0.02)
    about = json.loads((folder / graph / "result.json").read_text())
    assert about["pixel_sides_mm"] == pytest.approx([PIXEL_MM, LENGTH_MM], rel=1e-5)
    for name in ("height.npy", "height.tiff"):
        with pytest.raises(InputError, match=r"0\.1 x 0\.1081 mm.*grid 'metric'"):
            read_pixel_size(height=folder / graph / name)


def test_a_ball_that_looks_oblong_is_told(folder: Path) -> None:
    result = calibrated(folder, out="square.npz")
    assert any("8% longer than wide" in line for line in said(result)), result.warnings


@pytest.mark.slow
def test_a_one_shot_sensor_may_have_oblong_pixels(tmp_path: Path) -> None:
    def write_colours(place: str, height: np.ndarray, seed: int) -> str:
        (tmp_path / place).mkdir(parents=True)
        image = squeezed(taken(height, seed, leds(3))).transpose(1, 2, 0)
        cv2.imwrite(str(tmp_path / place / "colours.png"), image)
        return str(tmp_path / place)

    flat, touch = write_colours("flat", FLAT, 0), write_colours("touch", TOUCH, 1)
    for x, y in product((-4.7, -1.6, 1.3, 4.4), (-3.1, 0.2, 2.8)):
        ball = shape_ball(radius_mm=BALL_MM, rise_mm=0.8, offset_mm=(x, y), **CANVAS).height
        write_colours(f"presses/{x} {y}", ball, 2)
    given = {"captures": str(tmp_path / "presses"), "flat": flat, "ball_radius_mm": BALL_MM}

    def calibrated(pixel_size_mm: float | tuple[float, float], out: str) -> list[str]:
        out = str(tmp_path / out)
        return said(run("calibrate_presses", **given, pixel_size_mm=pixel_size_mm, out=out))

    assert not any("not square" in line for line in calibrated((PIXEL_MM, LENGTH_MM), "cal.npz"))
    assert any("8% longer than wide" in line for line in calibrated(PIXEL_MM, "square.npz"))
    calibration = str(tmp_path / "cal.npz")
    result = run("gelsight_mini", capture=touch, calibration=calibration, sinks=False)
    assert np.sqrt(np.mean((result["height"] - squeezed(TOUCH[None])[0]) ** 2)) < 0.008
