"""A wall hides the film at its foot from one of three colours."""

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes.height.integrate_dct import integrate_dct
from tactograph.nodes.height.rest_at_border import rest_at_border
from tactograph.nodes.shadow.cast_shadows import cast_shadows
from tactograph.nodes.simulate.press import press
from tactograph.rings.oneshot.nodes.map.mapped_light import mapped_light
from tactograph.rings.oneshot.nodes.map.reflectance_map import PLACE_TERMS, SHADE_COUNT
from tactograph.rings.oneshot.nodes.map.slope_in_shadow import slope_in_shadow
from tactograph.rings.oneshot.nodes.map.solve_reflectance_map import solve_reflectance_map

PIXEL, SHAPE, DEPTH = 0.1, (96, 120), 1.0
Y, X = PIXEL * (np.indices(SHAPE) - (np.array(SHAPE)[:, None, None] - 1) / 2)
INSIDE = 2 - np.maximum(np.abs(X), np.abs(Y))
FLAT = np.full((3, *SHAPE), 0.4, np.float32)
AZIMUTH, SLANT = np.radians([45, 165, 285]), np.radians(40)
DEVIATION = 0.01


def matt_film() -> F4:
    """The map of Lambert's law under three distant lights: n.l over that of level film."""
    found = np.zeros((3, SHADE_COUNT, PLACE_TERMS), np.float32)
    found[:, 0, 0], found[:, 1, 0] = np.tan(SLANT) * np.stack([np.cos(AZIMUTH), np.sin(AZIMUTH)])
    found[:, 2, 0] = 1
    return found


def punch(wall: float) -> tuple[F4, F4]:
    """Height and slope of film over a square with walls of this slope."""
    shape = np.clip(DEPTH + INSIDE * wall, 0, DEPTH).astype(np.float32)
    film = press(shape, PIXEL, reach_mm=0.15, skin_mm=0.03)
    slope = [np.gradient(film, PIXEL, axis=axis) for axis in (1, 0)]
    return film, np.asarray(slope, np.float32)


def seen(film: F4, slope: F4) -> F4:
    """The light of a film, dark where it hides itself from a light."""
    lights = 1e4 * np.stack([np.cos(AZIMUTH), np.sin(AZIMUTH), 1 / np.tan(SLANT) + 0 * AZIMUTH], 1)
    hidden = cast_shadows(film, lights.astype(np.float32), PIXEL)
    light = mapped_light(slope, film, matt_film())
    return np.stack([light[k] * ((hidden >> k & 1) == 0) for k in range(3)]).astype(np.float32)


def measured(light: F4, film: F4, deviation: float) -> tuple[F4, F4]:
    """Slope with shadows labelled at this deviation, and its height."""
    by_all = solve_reflectance_map(light, FLAT, 0 * film, matt_film())
    slope = slope_in_shadow(by_all, light, FLAT, 0 * film, matt_film(), deviation)
    return slope, rest_at_border(integrate_dct(slope, PIXEL))


def test_a_plateau_keeps_its_height_though_walls_shade_their_feet() -> None:
    film, slope = punch(3.7)
    light = seen(film, slope)
    plateau = INSIDE > 0.8
    off = [
        np.median((measured(light, film, deviation)[1] - film)[plateau])
        for deviation in (0.0, DEVIATION)
    ]
    assert abs(off[0]) > 0.15
    assert abs(off[1]) < abs(off[0]) / 3


def test_film_without_shadows_keeps_its_slope_to_the_bit() -> None:
    film, slope = punch(0.8)
    light = mapped_light(slope, film, matt_film())
    by_all = solve_reflectance_map(light, FLAT, 0 * film, matt_film())
    known = slope_in_shadow(by_all, light, FLAT, 0 * film, matt_film(), DEVIATION)
    np.testing.assert_array_equal(known, by_all)


def test_a_film_that_is_not_known_to_be_matt_keeps_all_lights() -> None:
    film, slope = punch(3.7)
    light = seen(film, slope)
    by_all = solve_reflectance_map(light, FLAT, 0 * film, matt_film())
    np.testing.assert_array_equal(measured(light, film, 0.0)[0], by_all)
