"""The shape of a film at rest, found from presses of a ball under near LEDs."""

import numpy as np
import pytest

from tactograph.nodes import Film
from tactograph.nodes.calibrate.ball.press_slopes import press_slopes
from tactograph.nodes.simulate.film_light import film_light
from tactograph.rings.curved_film.nodes.find_rest import bent, find_rest

SIZE, PIXEL_MM, RADIUS_MM, CONTACT_PX = (120, 160), 0.14, 6.0, 28.0
PLACES_PX = ((80.0, 60.0), (40.0, 42.0), (118.0, 80.0))
LIGHTS_MM = 25 * np.array([[1, 0, 1.3], [0, 1, 1.3], [-1, 0, 1.3], [0, -1, 1.3]], np.float32)


@pytest.mark.slow
@pytest.mark.parametrize("bend", [(-1 / 30, 0, -1 / 30), (1 / 25, 0, 0), (1 / 60, 1 / 90, -1 / 70)])
def test_a_bend_is_found_whichever_way_it_goes(bend: tuple[float, float, float]) -> None:
    """A dome that is highest in the middle, a cylinder, a saddle: Gauss-Newton from a plane."""
    shape, film = bent(SIZE, PIXEL_MM, 0.0, np.array([*bend, 0, 0])), Film.matt(LIGHTS_MM)
    count = len(PLACES_PX)
    circles = np.array([(*place, CONTACT_PX) for place in PLACES_PX], np.float32)
    radius, of = np.full(count, RADIUS_MM, np.float32), np.arange(count, dtype=np.int32)
    sheet = np.zeros((4, count * SIZE[0], SIZE[1]), np.float32)
    plane = np.ones((4, *SIZE), np.float32)
    slope, _, height = press_slopes(sheet, plane, circles, radius, of, PIXEL_MM, shape)
    y, x = ((np.arange(side) - (side - 1) / 2) * PIXEL_MM for side in SIZE)
    away = LIGHTS_MM[:, :2, None, None] - np.stack(np.broadcast_arrays(x, y[:, None]))
    fall = (np.square(away).sum(axis=1) + LIGHTS_MM[:, 2, None, None] ** 2) ** -1.5
    at_rest = shape.light(film)
    presses = zip(np.split(slope, count, axis=1), np.split(height, count), strict=True)
    light = [film_light(s, h, film, PIXEL_MM) / at_rest for s, h in presses]
    noise = np.random.default_rng(0).normal(0, 0.003, sheet.shape)
    found = find_rest(
        (np.concatenate(light, axis=1) + noise).astype(np.float32),
        (0.5 * fall / fall.max() * at_rest).astype(np.float32),
        plane,
        radius,
        np.full((count, 3), np.nan, np.float32),
        [str(number) for number in range(count)],
        PIXEL_MM,
        PIXEL_MM,
        1,
        np.array([1e-5, 1e-6], np.float32),
    )
    off_um = 1e3 * float(np.std(found.height - shape.height))
    assert off_um < 2 * found.quality["rest_deviation_um"] < 100
