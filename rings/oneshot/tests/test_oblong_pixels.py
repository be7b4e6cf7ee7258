"""One-shot sensors whose pixels are not square."""

from itertools import product
from pathlib import Path

import cv2
import numpy as np
import pytest

from tactograph.nodes.simulate.shape_ball import shape_ball
from tests.pipelines.matt_film import (
    BALL_MM,
    CANVAS,
    FLAT,
    PIXEL_MM,
    TOUCH,
    leds,
    run,
    taken,
    warnings_of,
)
from tests.pipelines.test_oblong_pixels import LENGTH_MM, oblong_percent, squeezed


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
    arguments = {"captures": str(tmp_path / "presses"), "flat": flat, "ball_radius_mm": BALL_MM}

    def calibrated(pixel_size_mm: float | tuple[float, float], out: str) -> list[str]:
        out = str(tmp_path / out)
        return warnings_of(
            run("calibrate_presses", **arguments, pixel_size_mm=pixel_size_mm, out=out)
        )

    assert not any("not square" in line for line in calibrated((PIXEL_MM, LENGTH_MM), "cal.npz"))
    percent = oblong_percent(calibrated(PIXEL_MM, "square.npz"))
    assert percent == pytest.approx(100 * (LENGTH_MM / PIXEL_MM - 1), abs=0.5)
    calibration = str(tmp_path / "cal.npz")
    result = run("gelsight_mini", capture=touch, calibration=calibration, sinks=False)
    assert np.sqrt(np.mean((result["height"] - squeezed(TOUCH[None])[0]) ** 2)) < 0.008
