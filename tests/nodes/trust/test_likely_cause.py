"""A touch that is doubted names the mistake that explains it, and no other."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.trust.likely_cause import likely_cause, matt_residual

ROWS, COLUMNS = 60, 80
LIGHTS = np.array([[-40, -30, 40], [42, -31, 40], [38, 33, 40], [-39, 30, 40]], np.float32)
Change = Callable[[F4], F4]


def flat() -> F4:
    """Each LED is brightest at its own corner."""
    y, x = np.mgrid[-1 : 1 : ROWS * 1j, -1 : 1 : COLUMNS * 1j]
    lean = [0.5 + 0.08 * (np.sign(u) * x + np.sign(v) * y) for u, v, _ in LIGHTS]
    return np.asarray(lean, np.float32)


def touch() -> F4:
    """A dome and a smaller one next to it."""
    y, x = np.mgrid[:ROWS, :COLUMNS].astype(np.float32)
    height = 6 * np.exp(-((x - 34) ** 2 + (y - 26) ** 2) / 120)
    height += 3 * np.exp(-((x - 52) ** 2 + (y - 38) ** 2) / 40)
    q, p = np.gradient(height)
    normal = np.stack([-p, -q, np.ones_like(p)]) / np.sqrt(1 + p * p + q * q)
    light = np.tensordot(LIGHTS / LIGHTS[:, 2:], normal, 1)
    return np.asarray(np.maximum(light, 0) * flat(), np.float32)


def banded(raw: F4) -> F4:
    rows = 1 - 0.1 * np.sin(np.arange(ROWS) / 1.5)[:, None]
    return np.asarray(raw * rows, np.float32)


def equalised(raw: F4) -> F4:
    """The share of darker pixels of the image, in place of the light."""
    order = raw.reshape(len(raw), -1).argsort(axis=1).argsort(axis=1)
    return np.asarray(order.reshape(raw.shape) / raw[0].size, np.float32)


def locally_equalised(raw: F4) -> F4:
    equalise = cv2.createCLAHE(4.0, (8, 8)).apply
    return np.stack([equalise((255 * plane).astype(np.uint8)) for plane in raw]) / np.float32(255)


def of_another_film(raw: F4) -> F4:
    rough = cv2.GaussianBlur(np.random.default_rng(1).normal(size=(ROWS, COLUMNS)), (0, 0), 3)
    return np.asarray(raw * (1 + 0.05 * rough / rough.std()), np.float32)


def of_a_nearer_sensor(raw: F4) -> F4:
    """Light that falls off more, and not as a power of the flat frame's."""
    off = flat() - 0.5
    return np.asarray(0.4 * raw / flat() * (1 + 4 * off + 16 * off**2), np.float32)


MISTAKES: dict[str, Change] = {
    "LED 1 and LED 2 are swapped": lambda raw: raw[[1, 0, 2, 3]],
    "LED 2 and LED 4 are swapped": lambda raw: raw[[0, 3, 2, 1]],
    "taken as 4, 1, 2, 3 they fit": lambda raw: raw[[1, 2, 3, 0]],
    "are mirrored left to right": lambda raw: raw[:, :, ::-1],
    "are mirrored top to bottom": lambda raw: raw[:, ::-1],
    "are turned by half": lambda raw: raw[:, ::-1, ::-1],
    "look like negatives": lambda raw: 1 - raw,
    "as if a gamma had been applied": lambda raw: raw ** np.float32(1 / 2.2),
    "the light flickers": banded,
    "has 2.2 times the contrast of the flat frame": lambda raw: raw ** np.float32(2.2),
    "the image of LED 3 is not of the touch": lambda raw: np.concatenate(
        [raw[:2], np.roll(raw / flat(), 9, 2)[2:3] * flat()[2:3], raw[3:]]
    ),
    "torn: from 60% of their height on they show the next LED": lambda raw: np.concatenate(
        [raw[:, :36], np.roll(raw[:, 36:], -1, 0)], axis=1
    ),
    "has 3.8 times the contrast of the flat frame": equalised,
    "LED 1 and LED 3 show the same light": lambda raw: raw[[0, 1, 0, 3]],
    "switch off local contrast": locally_equalised,
    "check that it is the film of the calibration": of_another_film,
    "check that the calibration is this sensor's": of_a_nearer_sensor,
}


def cause(light: F4, *, has_walls: bool = False) -> str:
    """The cause of a touch, where valid touches leave up to 1.5 times the residual of this one."""
    usual = 1.5 * matt_residual(touch() / flat(), flat(), LIGHTS)
    return likely_cause(light, flat(), LIGHTS, lambda res: res < usual, has_walls=has_walls)


@pytest.mark.parametrize("words", MISTAKES)
def test_a_mistake_is_named(words: str) -> None:
    assert words in cause(MISTAKES[words](touch()) / flat())


def test_what_a_wall_shades_is_no_image_of_another_touch() -> None:
    """A rigid ball's own press was told as one LED's image of another touch."""
    words = "the image of LED 3 is not of the touch"
    light = MISTAKES[words](touch()) / flat()
    assert words in cause(light)
    assert words not in cause(light, has_walls=True)


def test_images_of_a_square_sensor_are_named_as_transposed() -> None:
    raw, rest = touch()[:, :, 10:70], flat()[:, :, 10:70]
    usual = 1.5 * matt_residual(raw / rest, rest, LIGHTS)
    turned = raw.transpose(0, 2, 1) / rest
    assert "are transposed" in likely_cause(turned, rest, LIGHTS, lambda residual: residual < usual)


def test_a_frame_that_is_cut_off_is_not_taken_for_flicker() -> None:
    cut = touch() / flat()
    cut[:, 45:] = 0
    assert "flickers" not in cause(cut)


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_a_touch_that_fits_except_for_its_brightness_has_no_cause(share: float) -> None:
    assert not cause(np.float32(share) * touch() / flat())


def test_light_that_no_mistake_explains_has_no_cause() -> None:
    noise = np.random.default_rng(3).normal(1, 0.3, (4, ROWS, COLUMNS)).astype(np.float32)
    assert not cause(noise)
    assert not cause(np.ones((4, ROWS, COLUMNS), np.float32))
