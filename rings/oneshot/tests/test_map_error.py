"""What walls add to the error of a one-shot sensor's height."""

import numpy as np

from rings.oneshot.tests.test_map_departure import reflectance
from tactograph.nodes import F4
from tactograph.nodes.contact.find_contact import find_contact
from tactograph.nodes.height.integrate_dct import integrate_dct
from tactograph.nodes.height.rest_at_border import rest_at_border
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.simulate.press import press
from tactograph.rings.oneshot.nodes.map.map_error import map_error
from tactograph.rings.oneshot.nodes.map.mapped_light import mapped_light
from tactograph.rings.oneshot.nodes.map.smooth_slope import smooth_slope
from tactograph.rings.oneshot.nodes.map.solve_reflectance_map import solve_reflectance_map

PIXEL, SHAPE = 0.1, (96, 120)
Y, X = PIXEL * (np.indices(SHAPE) - (np.array(SHAPE)[:, None, None] - 1) / 2)
INSIDE = 2 - np.maximum(np.abs(X), np.abs(Y))
FLAT = np.full((3, *SHAPE), 0.4, np.float32)


def punch(depth: float, wall: float) -> F4:
    """Film over a square with walls of this slope."""
    shape = np.clip(depth + INSIDE * wall, 0, depth).astype(np.float32)
    return press(shape, PIXEL, reach_mm=0.15, skin_mm=0.03)


def found(film: F4, dimmed: float = 0.0, departure: float = 0.01) -> tuple[F4, F4]:
    """Height of the film and its error, from light that the wall's slope saturates by a share."""
    slope = np.stack([np.gradient(film, PIXEL, axis=1), np.gradient(film, PIXEL, axis=0)])
    shown = (slope * (1 - dimmed)).astype(np.float32)
    light = mapped_light(shown, film, reflectance(3))
    solved = smooth_slope(solve_reflectance_map(light, FLAT, film, reflectance(3)))
    height = rest_at_border(integrate_dct(solved, PIXEL))
    misfit = np.array([0, 0, departure, 0, 0], np.float32)
    return height, map_error(height, solved, coarsen(light), reflectance(3), misfit, PIXEL)


def test_plateaus_lie_within_two_stated_deviations() -> None:
    middle = INSIDE > 0.8
    for depth in (0.25, 0.5, 1.0):
        for wall in (1.0, 1.7, 10.0):
            film = punch(depth, wall)
            height, error = found(film)
            off = abs(np.median(height[middle]) - np.median(film[middle]))
            assert off < 2 * np.median(error[middle])


def test_walls_carry_their_error_to_the_plateau() -> None:
    middle = INSIDE > 0.8
    shallow, deep = (np.median(found(punch(depth, 10.0))[1][middle]) for depth in (0.25, 1.0))
    assert deep > 2 * shallow
    known, doubtful = (
        np.median(found(punch(0.5, 1.0), departure=each)[1][middle]) for each in (0.01, 0.1)
    )
    assert doubtful > 2 * known


def test_the_top_of_a_flat_punch_counts_as_contact() -> None:
    for depth in (0.1, 0.25, 1.0):
        height, error = found(punch(depth, 10.0), dimmed=0.4)
        contact = find_contact(height, error, enter=4.0, leave=2.0)
        assert contact.max() == 1
        assert (contact[INSIDE > 0.2] == 1).all()


def test_film_at_rest_errs_by_its_height() -> None:
    height, error = found(np.zeros(SHAPE, np.float32))
    assert (error >= np.abs(height)).all()
    assert find_contact(height, error, enter=4.0, leave=2.0).max() == 0
