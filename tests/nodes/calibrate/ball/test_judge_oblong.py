"""A ball reveals pixels that are not square."""

import cv2
import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.calibrate.ball.find_ball import find_ball
from tactograph.nodes.calibrate.ball.judge_oblong import judge_oblong
from tests.fixtures import RIG_PIXEL_MM, Raytraced
from tests.nodes.calibrate.film.test_judge_radius import image_of

BALL_MM = 7.0


def judged(
    folder: Raytraced, rig: str, rows: float = 1.0, columns: float = 1.0, off_px: float = 0.0
) -> list[str]:
    """The doubts about a rig with images resized by these factors and a misplaced ball."""

    def resized(planes: F4) -> F4:
        return np.stack([cv2.resize(p, None, None, columns, rows, cv2.INTER_AREA) for p in planes])

    press, flat = (resized(image_of(folder / rig / name)) for name in ("calibration", "flat"))
    light, pixel = press / flat, RIG_PIXEL_MM[rig]
    ball = find_ball(light, pixel, radius_mm=BALL_MM)
    circle = np.array([[*(ball.center + off_px), ball.contact], [0, 0, 0]], np.float32)
    goodness, of = np.array([ball.goodness, 0], np.float32), np.zeros(2, np.int32)
    return judge_oblong(light, flat, circle, goodness, of, pixel, np.full(2, BALL_MM, np.float32))


@pytest.mark.one_case
@pytest.mark.parametrize("rig", ["far28", "near33"])
def test_square_pixels_give_no_doubt(raytraced: Raytraced, rig: str) -> None:
    assert judged(raytraced, rig) == []
    assert judged(raytraced, rig, off_px=2) == []


@pytest.mark.one_case
@pytest.mark.parametrize("rig", ["far28", "near33"])
def test_sides_that_differ_by_two_per_cent_give_a_doubt(raytraced: Raytraced, rig: str) -> None:
    (doubt,) = judged(raytraced, rig, rows=1 / 1.02)
    assert "% longer than wide" in doubt
    (doubt,) = judged(raytraced, rig, columns=1 / 1.02)
    assert "% wider than long" in doubt


def test_without_a_ball_there_is_no_doubt() -> None:
    light, none = np.ones((4, 8, 8), np.float32), np.zeros((1, 3), np.float32)
    evidence = none, np.zeros(1, np.float32), np.zeros(1, np.int32), 0.1, none[:, 0]
    assert judge_oblong(light, light, *evidence) == []
