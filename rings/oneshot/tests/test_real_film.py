"""A real film under three LEDs, as the colours of a one-shot sensor."""

import cv2
import numpy as np
import pytest

from tests.pipelines.conftest import run
from tests.pipelines.test_films import PIXEL_MM, RADIUS_MM, Sensor, degrees, sensor

__all__ = ["sensor"]


@pytest.mark.slow
def test_one_press_of_a_grid_calibrates_a_sensor_of_three_colours(sensor: Sensor) -> None:
    """Three of the LEDs as the colours of one image, against all balls of another scan."""
    folder = sensor.scan.parent
    for name, place in {"flat": "film", "balls_1": "grid/1", "balls_2": "touch"}.items():
        planes = [cv2.imread(str(folder / name / f"led{k}.png"), -1) for k in (2, 4, 6)]
        (folder / "colours" / place).mkdir(parents=True)
        cv2.imwrite(str(folder / "colours" / place / "colours.png"), np.dstack(planes))
    run(
        "calibrate_presses", folder / "colours.npz", captures=folder / "colours/grid",
        flat=folder / "colours/film", ball_radius_mm=RADIUS_MM, pixel_size_mm=PIXEL_MM,
        ball_pitch_mm=1.0,
    )  # fmt: skip
    arguments = {"capture": folder / "colours/touch", "calibration": folder / "colours.npz"}
    assert degrees(run("gelsight_mini", **arguments)["height"], sensor.centres) < 1.8
