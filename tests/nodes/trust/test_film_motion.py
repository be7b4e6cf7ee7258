"""A camera that has moved since the flat frame was taken shows in the film at rest."""

import cv2
import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.trust.fall_off import fall_off
from tactograph.nodes.trust.film_motion import film_motion, motion_in_words, motion_size

ROWS, COLUMNS = 60, 80
ROOM = np.s_[:, 6:54, 6:74]


def rest() -> F4:
    """Four near LEDs, each brightest at its own corner."""
    y, x = np.mgrid[-30.0:30.0, -40.0:40.0] / 5
    away = [
        (x - u) ** 2 + (y - v) ** 2 + 40**2 for u, v in ((-30, -30), (30, -30), (30, 30), (-30, 30))
    ]
    return np.asarray([900 / a for a in away], np.float32)


def light_from(matrix: list[list[float]]) -> F4:
    """The light after a motion, with a touch and noise, relative to the flat frame."""
    to = np.array(matrix, float)
    moved = [
        cv2.warpAffine(p, to, (COLUMNS, ROWS), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                       borderMode=cv2.BORDER_REPLICATE)
        for p in rest()
    ]  # fmt: skip
    light = np.stack(moved) / rest() * (1 + np.random.default_rng(2).normal(0, 0.001, rest().shape))
    light[ROOM] *= 1.2
    light[:, :12, 60:] *= np.array([1.3, 0.6, 0.8, 1.1])[:, None, None]  # a touch at the border
    return light.astype(np.float32)


def about(scale: float, degrees: float) -> list[list[float]]:
    middle = (COLUMNS - 1) / 2, (ROWS - 1) / 2
    return cv2.getRotationMatrix2D(middle, degrees, scale).tolist()  # type: ignore[no-any-return]


MOTIONS = {
    "width further right": ([[1.0, 0.0, -4.0], [0.0, 1.0, 0.0]], (-0.05, 0, 0, 0)),
    "width further up": ([[1.0, 0.0, 0.0], [0.0, 1.0, 3.0]], (0, 0.04, 0, 0)),
    "% larger": (about(0.95, 0.0), (0, 0, -0.05, 0)),
    "% smaller": (about(1.05, 0.0), (0, 0, 0.05, 0)),
    " degrees": (about(1.0, 6.0), (0, 0, 0, -0.1)),
}


@pytest.mark.parametrize("words", MOTIONS)
def test_a_motion_is_found_and_named(words: str) -> None:
    matrix, true = MOTIONS[words]
    motion = film_motion(light_from(matrix), fall_off(rest()), rest())
    np.testing.assert_allclose(motion[:4], true, atol=0.02)
    assert words in motion_in_words(motion)
    assert motion_size(motion) > 0.02


@pytest.mark.parametrize("added", [0.01, 0.05, -0.02])
@pytest.mark.parametrize("gain", [1.0, 0.8])
def test_added_light_is_found_whatever_the_exposure(added: float, gain: float) -> None:
    """Beside a touch that changes the film, and one that leaves the frame."""
    light = np.float32(gain) * light_from([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    motion = film_motion(light + np.float32(gain * added) / rest(), fall_off(rest()), rest())
    ring = fall_off(rest()).any(axis=(0, 1))
    share = gain * added * float((1 / rest()[:, ring]).mean())
    assert motion[4] == pytest.approx(share, rel=0.15)


def test_leds_that_drift_are_no_motion() -> None:
    right = light_from([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    assert not film_motion(right, fall_off(rest()), rest()).any()
    y, x = np.mgrid[-1 : 1 : ROWS * 1j, -1 : 1 : COLUMNS * 1j]
    rng = np.random.default_rng(3)
    sizes = []
    for _ in range(20):
        level, along, down = rng.normal(0, [[0.03], [0.01], [0.01]], (3, 4))
        drift = 1 + level[:, None, None] + along[:, None, None] * x + down[:, None, None] * y
        sizes.append(
            motion_size(film_motion((right * drift).astype(np.float32), fall_off(rest()), rest()))
        )
    assert np.median(sizes) == 0
    assert max(sizes) < 0.03


def test_a_film_that_is_lit_evenly_shows_no_motion() -> None:
    even = np.full((4, ROWS, COLUMNS), 0.5, np.float32)
    assert not film_motion(light_from(about(0.9, 0.0)), fall_off(even), even).any()
    assert not film_motion(np.full_like(even, 1.1), fall_off(even), even).any()
