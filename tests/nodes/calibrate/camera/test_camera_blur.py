"""The camera's blur, measured on the rims of balls."""

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from tactograph.nodes import F4
from tactograph.nodes.calibrate.camera.camera_blur import camera_blur

ROWS, COLUMNS, FINE = 120, 160, 8
MIDDLE, RADIUS = (83.3, 58.9), 36.0


def press(blur_px: float, rim_px: float = 0.0, step: float = 0.6) -> F4:
    """Two LEDs, and a ball that is darker than the film around it, with a rounded rim."""
    y, x = (np.indices((ROWS * FINE, COLUMNS * FINE)) + 0.5) / FINE - 0.5
    away = np.hypot(x - MIDDLE[0], y - MIDDLE[1])
    ball = np.clip((RADIUS - away) / rim_px + 0.5, 0, 1) if rim_px else away < RADIUS
    fine = gaussian_filter(1 - step * ball.astype(np.float32), blur_px * FINE)
    image = cv2.resize(fine, (COLUMNS, ROWS), interpolation=cv2.INTER_AREA)
    noise = np.random.default_rng(1).normal(0, 0.01, (2, ROWS, COLUMNS))
    return np.float32(0.6 * image + noise)


FLAT = np.full((2, ROWS, COLUMNS), 0.6, np.float32)


def blur_of(image: F4, radius: float = RADIUS, binned: float = 0.1) -> float:
    scale = 0.1 / binned
    place = ((c + 0.5) * scale - 0.5 for c in MIDDLE)
    circle, of = np.float32([[*place, radius * scale]]), np.zeros(1, np.int32)
    return camera_blur(image, FLAT, circle, of, 0.1, binned).blur


@pytest.mark.parametrize("blur_px", [0.4, 0.8, 1.5])
def test_the_blur_is_found(blur_px: float) -> None:
    assert blur_of(press(blur_px)) == pytest.approx(blur_px, rel=0.15)


def test_a_sharp_camera_has_no_blur() -> None:
    assert blur_of(press(0.0)) < 0.25


def test_the_circle_may_be_off_and_of_larger_pixels() -> None:
    assert blur_of(press(0.8), radius=0.93 * RADIUS, binned=0.2) == pytest.approx(0.8, rel=0.15)


def test_faint_rims_and_a_missing_ball_give_no_blur() -> None:
    assert blur_of(press(0.8, step=0.05)) == 0
    assert blur_of(press(0.8), radius=0) == 0
