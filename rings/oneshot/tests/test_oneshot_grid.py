"""A one-shot sensor that is calibrated with a grid of balls, under a camera with a lens."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from rings.camera.tests.grids import dots, on_film, pixels
from tactograph.graph import InputError
from tactograph.nodes import F4
from tactograph.nodes.height.distort_height import distort_height
from tactograph.nodes.simulate.press import press
from tactograph.nodes.simulate.shape_ball import shape_ball
from tests.pipelines.matt_film import CANVAS, FLAT, PIXEL_MM, TOUCH, leds, run, taken, warnings_of

RADIUS_MM, PITCH_MM, DEEP_MM = 1.2, 3.0, 0.5
LENS = np.array([0.04, 0, 0, 0, 0, 0, 0, 0], np.float32)
LEDS = leds(3, distance_mm=25.0)


def grid_of_balls(x: float, y: float, degrees: float) -> F4:
    """Film into which a grid of 5 x 3 balls is pressed, its middle ball at x, y in mm."""
    turn = np.exp(1j * np.radians(degrees))
    places = [PITCH_MM * (i + 1j * j) * turn for i in range(-2, 3) for j in range(-1, 2)]
    caps = [
        shape_ball(
            radius_mm=RADIUS_MM, rise_mm=DEEP_MM, offset_mm=(x + at.real, y + at.imag), **CANVAS
        ).height
        for at in places
    ]
    return press(np.max(caps, axis=0), PIXEL_MM, reach_mm=0.3, skin_mm=0.05)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two presses of the grid, the untouched film, a touch and dots, all through the lens."""
    made = tmp_path_factory.mktemp("grid")
    films = {"flat": FLAT, "touch": TOUCH}
    films |= {"balls/1": grid_of_balls(0.3, 0.4, 4), "balls/2": grid_of_balls(-0.8, -0.9, -6)}
    for seed, (name, film) in enumerate(films.items()):
        (made / name).mkdir(parents=True)
        planes = [
            distort_height(plane.astype(np.float32), LENS) for plane in taken(film, seed, LEDS)
        ]
        image = np.rint(planes).clip(0, 255).astype(np.uint8).transpose(1, 2, 0)
        cv2.imwrite(str(made / name / "colours.png"), image)
    image = pixels(dots(*on_film(FLAT.shape, LENS, 1.2 / PIXEL_MM, 0.02, (0.1, 0.2))))
    cv2.imwrite(str(made / "dots.png"), np.rint(255 * image).astype(np.uint8))
    run("calibrate_camera", image=str(made / "dots.png"), pitch_mm=1.2, out=str(made / "cam.npz"))
    return made


def calibrated(folder: Path, **arguments: object) -> object:
    captures = {"captures": str(folder / "balls"), "flat": str(folder / "flat")}
    out = str(folder / "cal.npz")
    return run("calibrate_presses", **captures, ball_radius_mm=RADIUS_MM, out=out, **arguments)


@pytest.mark.slow
def test_two_presses_of_a_grid_calibrate(folder: Path) -> None:
    """A ball that is four times as large and was not seen, and each ball counts as a press."""
    result = calibrated(folder, ball_pitch_mm=PITCH_MM, lens=str(folder / "cam.npz"))
    assert result["quality"]["presses"] >= 24
    assert result["quality"]["heldout_normal_deg"] < 1.5
    arguments = {"capture": str(folder / "touch"), "calibration": str(folder / "cal.npz")}
    found = run("gelsight_mini", **arguments, sinks=False)
    assert not warnings_of(found)
    off = found["height"] - distort_height(TOUCH, LENS)
    assert np.sqrt(np.mean(off**2)) < 0.012


def test_a_grid_without_its_pitch_is_refused(folder: Path) -> None:
    with pytest.raises(InputError, match="give ball_pitch_mm=MM if a press shows a grid of balls"):
        calibrated(folder, pixel_size_mm=PIXEL_MM)
