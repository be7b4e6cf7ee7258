"""Where a camera blurs the end of a shadow, the light that is missing is in doubt."""

import cv2
import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.shadow.doubt_penumbra import doubt_penumbra
from tactograph.nodes.shadow.label_lights import label_lights

PIXEL, SIGMA, BLUR = 0.1, 0.005, 0.8
SHAPE = 24, 40
LEDS = np.float32([[-40, 30, 50], [-40, -30, 50], [40, 30, 50], [40, -30, 50]])
FILM, LEVEL = np.zeros(SHAPE, np.float32), np.zeros((2, *SHAPE), np.float32)
EDGE = 15
"""The first column that no shadow reaches."""


def shadows_of_two() -> F4:
    """Level film; a blurred shadow of the LEDs at the left covers the columns before `EDGE`."""
    light = np.ones((4, *SHAPE), np.float32)
    light[:2, :, :EDGE] = 0
    return np.stack([cv2.GaussianBlur(each, (0, 0), BLUR) for each in light])


def doubted(light: F4, refraction: float = 1.0, blur: float = BLUR, diffuse: float = 0.0) -> F4:
    sigma = np.full_like(light, SIGMA)
    expected = LEDS, FILM, LEVEL, LEDS
    return doubt_penumbra(
        sigma, light, *expected, PIXEL, blur, refraction, np.full(4, diffuse, np.float32)
    )


def test_the_light_that_is_missing_at_a_shadow_s_end_is_in_doubt() -> None:
    light = shadows_of_two()
    deviation = doubted(light)
    assert deviation[:2, 12, EDGE - 1 : EDGE + 1] == pytest.approx(
        1 - light[:2, 12, EDGE - 1 : EDGE + 1], abs=0.02
    )
    assert deviation[:, :, EDGE + 4 :] == pytest.approx(SIGMA)
    assert deviation[2:] == pytest.approx(SIGMA)


def test_film_that_turns_away_from_an_led_beside_its_shadow_is_not_in_doubt() -> None:
    """There the dark film lies away from the LED."""
    light = shadows_of_two()[:, :, ::-1]
    assert doubted(light)[:, :, : SHAPE[1] - EDGE - 1] == pytest.approx(SIGMA)


@pytest.mark.parametrize("settings", [{"refraction": 1.5}, {"blur": 0.0}, {"diffuse": 0.2}])
def test_under_a_coat_in_a_gel_and_for_a_sharp_camera_nothing_changes(
    settings: dict[str, float],
) -> None:
    assert doubted(shadows_of_two(), **settings) == pytest.approx(SIGMA)


def test_level_film_stays_level_where_two_shadows_end_together() -> None:
    light = shadows_of_two()
    steepest = {}
    for name, sigma in (("doubted", doubted(light)), ("trusted", np.full_like(light, SIGMA))):
        found = label_lights(light, sigma, LEDS, FILM, LEVEL, PIXEL, 0.03, pair="prior")
        steepest[name] = np.abs(found.slope[:, :, EDGE - 2 : EDGE + 3]).max()
    assert steepest["doubted"] < 0.25 * steepest["trusted"]
