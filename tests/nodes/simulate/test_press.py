"""A film over an object."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from tactograph.nodes.simulate.press import press
from tactograph.nodes.simulate.shape_ball import shape_ball

PIXEL = 0.1


def ball(**settings):
    return shape_ball(width_px=121, height_px=121, pixel_size_mm=PIXEL, **settings)


def in_front(object, stand_off):
    return np.maximum(object - np.float32(stand_off), 0)


def test_bare_film_is_the_object_in_front_of_the_film_at_rest():
    shape = ball()
    film = press(*shape, stand_off_mm=5.5, reach_mm=0.0, skin_mm=0.0)
    np.testing.assert_array_equal(film, in_front(shape.height, 5.5))


@settings(max_examples=15)
@given(stand_off=st.floats(0, 3.9), reach=st.floats(0, 3))
def test_film_never_cuts_the_object_and_never_rises_above_it(stand_off, reach):
    shape = ball(radius_mm=4.0)
    film = press(*shape, stand_off_mm=stand_off, reach_mm=reach, skin_mm=0.0)
    obstacle = in_front(shape.height, stand_off)
    assert (film >= obstacle).all()
    assert film.max() <= obstacle.max() * (1 + 1e-4)


def test_free_film_balances_tension_and_stiffness():
    # Where nothing holds it: reach^2 * Laplacian(z) = z.
    shape, reach = shape_ball(radius_mm=4.0, width_px=160, height_px=120, pixel_size_mm=1 / 7), 0.8
    film = press(*shape, stand_off_mm=1.5, reach_mm=reach, skin_mm=0.0).astype(float)
    free = (film > in_front(shape.height, 1.5) + 1e-3)[1:-1, 1:-1]
    middle = film[1:-1, 1:-1]
    around = film[:-2, 1:-1] + film[2:, 1:-1] + film[1:-1, :-2] + film[1:-1, 2:]
    bending = (around - 4 * middle) * (7 * reach) ** 2
    np.testing.assert_allclose(bending[free], middle[free], atol=2e-3)


def test_film_returns_to_rest_exponentially_from_a_long_ridge():
    ridge = np.zeros((3, 201), np.float32)
    ridge[:, 98:103] = 1.0
    film = press(ridge, PIXEL, reach_mm=0.8, skin_mm=0.0)[1]
    distance = np.arange(1, 30) * PIXEL
    np.testing.assert_allclose(film[103:132], np.exp(-distance / 0.8), atol=5e-3)


def test_pressing_deeper_raises_the_film_everywhere():
    deep, shallow = (press(*ball(), stand_off_mm=s) for s in (4.0, 6.0))
    assert (deep >= shallow - 1e-6).all()


def test_tighter_film_touches_less():
    shape = shape_ball(radius_mm=4.0, width_px=160, height_px=120, pixel_size_mm=1 / 7)
    obstacle = in_front(shape.height, 2.0)
    films = (press(*shape, stand_off_mm=2.0, reach_mm=r, skin_mm=0.0) for r in (0.3, 3.0))
    loose, tight = (np.count_nonzero((obstacle > 0) & (film <= obstacle)) for film in films)
    assert 0 < tight < loose


def test_skin_rounds_the_kinks_and_keeps_the_volume():
    sharp, soft = (
        press(*ball(radius_mm=3.0), stand_off_mm=2.0, reach_mm=0.0, skin_mm=s) for s in (0.0, 0.3)
    )
    assert np.abs(np.diff(soft, 2)).max() < 0.5 * np.abs(np.diff(sharp, 2)).max()
    assert soft.sum() == pytest.approx(sharp.sum(), rel=1e-4)


@pytest.mark.parametrize("stand_off", [3.0, 10.0])
def test_object_that_does_not_reach_the_film_leaves_it_at_rest(stand_off):
    assert not press(*ball(radius_mm=3.0), stand_off_mm=stand_off).any()


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (7, 11)])
def test_level_object_lifts_the_film_level_whatever_the_size(size):
    np.testing.assert_allclose(press(np.ones(size, np.float32), PIXEL), 1.0, atol=1e-5)
