"""The camera's blur, measured on the rims of balls."""

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from tactograph.nodes import F4, Film
from tactograph.nodes.calibrate.camera._ball_ring import BallRing
from tactograph.nodes.calibrate.camera._fold_light import folds
from tactograph.nodes.calibrate.camera.camera_blur import camera_blur
from tactograph.nodes.optics.film import predict
from tests.nodes.films import LEDS, MATT

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


NOISE = np.float32([1e-4, 0])


def soft_press(blur_px: float, film: Film) -> F4:
    """A ball in a film that leaves it within some pixels, and goes back to rest over 6 px."""
    y, x = np.indices((ROWS, COLUMNS)).astype(np.float64)
    dx, dy = x - MIDDLE[0], y - MIDDLE[1]
    away = np.hypot(dx, dy)
    at = np.arange(-0.25, away.max() + 1, 0.25)
    bare = np.where(at < RADIUS, at / 1.4 / RADIUS, np.exp((RADIUS - at) / 6) / 1.4)
    slope = gaussian_filter(np.tan(np.arcsin(bare)), 2.0 / 0.25)
    height = 0.1 * 0.25 * np.cumsum(slope[::-1])[::-1]
    falls, z = np.interp(away, at, slope), np.interp(away, at, height)
    outward = falls / np.maximum(away, 1e-6)
    n = np.stack([outward * dx, outward * dy, np.ones_like(z)]) / np.sqrt(1 + falls**2)
    place = (x - (COLUMNS - 1) / 2) * 0.1, (y - (ROWS - 1) / 2) * 0.1, z
    flat = [part.ravel() for part in (n.reshape(3, -1), *place)]
    light = predict(film, flat[0].reshape(3, -1), *flat[1:]).reshape(-1, ROWS, COLUMNS)
    image = 0.6 * np.stack([gaussian_filter(plane, blur_px) for plane in light])
    noise = np.random.default_rng(2).normal(0, 1, image.shape)
    return np.float32(image + noise * np.sqrt(NOISE[0] * image))


@pytest.mark.parametrize("diffuse", [0.0, 0.3])
def test_a_film_that_bends_gently_is_no_blur(diffuse: float) -> None:
    film = MATT._replace(diffuse=np.full(len(LEDS), diffuse, np.float32), uneven=0.002)
    circle, of = np.float32([[*MIDDLE, RADIUS]]), np.zeros(1, np.int32)
    flat = np.full((len(LEDS), ROWS, COLUMNS), 0.6, np.float32)

    def width(blur_px: float, **known: object) -> float:
        return camera_blur(soft_press(blur_px, film), flat, circle, of, 0.1, 0.1, **known).blur

    assert width(0.5) > 1.5
    for blur_px in (0.0, 0.5, 1.0):
        # The variance, and what is uncertain of it.
        assert 0.9 * blur_px < width(blur_px, film=film, noise=NOISE) < np.hypot(blur_px, 0.9)
    # Where film lights itself, folds are brighter than their slopes make them.
    assert width(0.5, film=film._replace(albedo=0.5), noise=NOISE) > 1.5


@pytest.mark.parametrize("lit", [1, 2])
def test_folds_under_too_few_leds_tell_nothing(lit: int) -> None:
    """Images without noise, as JPEG leaves them, ended the calibration by a singular matrix."""
    flat, image = np.full((len(LEDS), ROWS, COLUMNS), 0.6, np.float32), soft_press(0.5, MATT)
    image[lit:] = 0
    ring = BallRing.of(flat.shape[1:], MIDDLE, 0.5 * RADIUS, 1.5 * RADIUS)
    noise = np.full(2, 1e-8, np.float32)
    assert folds(image, flat, ring, 6, MATT, noise, 0.1).most_blur(0.0) == np.inf
