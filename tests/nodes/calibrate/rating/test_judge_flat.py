"""A flat frame that shows a touch is reported, however faint."""

import cv2
import numpy as np
import pytest

from tactograph.nodes.calibrate.rating.judge_flat import judge_flat
from tests.fixtures import RIG_PIXEL_MM, Raytraced
from tests.nodes.calibrate.film.test_judge_radius import image_of

LIGHTS = np.array([[25, 25, 40], [-25, 25, 40], [-25, -25, 40], [25, -25, 40]], np.float32)
RIG = "near33"


@pytest.mark.parametrize(("share", "reported"), [(0.0, False), (0.1, True), (1.0, True)])
def test_a_share_of_a_touch_is_reported(raytraced: Raytraced, share: float, reported: bool) -> None:
    flat, touch = image_of(raytraced / RIG / "flat"), image_of(raytraced / RIG / "cat_film")
    mean = np.asarray((1 - share) * flat + share * touch, np.float32)
    doubts = judge_flat(mean, LIGHTS, RIG_PIXEL_MM[RIG])
    assert ["not at rest" in doubt for doubt in doubts] == [True] * reported


def test_local_contrast_is_named(raytraced: Raytraced) -> None:
    """It was once reported as a wrong radius."""
    flat = np.round(255 * image_of(raytraced / RIG / "flat")).astype(np.uint8)
    clahe = cv2.createCLAHE(4, (8, 8))
    equalised = np.stack([clahe.apply(plane) for plane in flat]) / np.float32(255)
    (doubt,) = judge_flat(equalised, LIGHTS, RIG_PIXEL_MM[RIG])
    assert "local contrast off" in doubt


def test_film_that_is_bright_in_places_is_at_rest(raytraced: Raytraced) -> None:
    flat = image_of(raytraced / RIG / "flat")
    grain = cv2.GaussianBlur(np.random.default_rng(1).normal(size=flat.shape[1:]), (0, 0), 5)
    assert not judge_flat(flat * np.float32(1 + 2 * grain), LIGHTS, RIG_PIXEL_MM[RIG])


def test_three_leds_or_a_missing_flat_frame_give_no_verdict(raytraced: Raytraced) -> None:
    touch = image_of(raytraced / RIG / "cat_film")
    assert not judge_flat(touch[:3], LIGHTS[:3], RIG_PIXEL_MM[RIG])
    assert not judge_flat(np.ones_like(touch), LIGHTS, RIG_PIXEL_MM[RIG])
