"""A film over an object."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tactograph.graph import InputError
from tactograph.nodes.press import press
from tactograph.nodes.shape_ball import shape_ball
from tactograph.nodes.shape_cat import shape_cat

PIXEL = 0.1
BARE = {"reach_mm": 0.0, "skin_mm": 0.0}


def ball(**settings):
    return shape_ball(width_px=121, height_px=121, pixel_size_mm=PIXEL, **settings)


def test_bare_film_is_the_object_less_the_stand_off():
    shape = ball()
    film = press(*shape, depth_mm=1.5, **BARE)
    stand_off = shape.height.max() - 1.5
    np.testing.assert_allclose(film.height, np.maximum(shape.height - stand_off, 0), atol=1e-6)
    np.testing.assert_array_equal(film.contact == 1, film.height > 0)


@settings(deadline=None, max_examples=15)
@given(depth=st.floats(0.1, 3), reach=st.floats(0, 3))
def test_film_never_cuts_the_object_and_never_rises_above_its_top(depth, reach):
    shape = ball(radius_mm=4.0)
    film = press(*shape, depth_mm=depth, reach_mm=reach, skin_mm=0.0)
    obstacle = np.maximum(shape.height - (shape.height.max() - np.float32(depth)), 0)
    assert (film.height >= obstacle - 1e-5).all()
    assert film.height.max() <= depth * (1 + 1e-4)
    touching = film.contact == 1
    np.testing.assert_allclose(film.height[touching], obstacle[touching], atol=1e-5)


def test_film_comes_back_to_rest_exponentially_from_a_long_ridge():
    ridge = np.zeros((3, 201), np.float32)
    ridge[:, 98:103] = 1.0
    film = press(ridge, PIXEL, reach_mm=0.8, skin_mm=0.0).height[1]
    distance = np.arange(1, 30) * PIXEL
    np.testing.assert_allclose(film[103:132], np.exp(-distance / 0.8), atol=5e-3)


def test_pressing_deeper_touches_more():
    areas = [press(*ball(), depth_mm=d).contact.sum() for d in (0.2, 0.5, 1.0, 2.0)]
    assert areas == sorted(areas)
    assert areas[0] < areas[-1]


def test_tighter_film_touches_less():
    shape = shape_cat(width_px=160, height_px=120, pixel_size_mm=1 / 7)
    loose, tight = (press(*shape, depth_mm=1.5, reach_mm=r).contact.sum() for r in (0.3, 3.0))
    assert tight < loose


def test_skin_rounds_the_kinks_and_keeps_the_volume():
    sharp, round_ = (
        press(*ball(radius_mm=3.0), depth_mm=1.0, reach_mm=0.0, skin_mm=s).height
        for s in (0.0, 0.3)
    )
    assert np.abs(np.diff(round_, 2)).max() < 0.5 * np.abs(np.diff(sharp, 2)).max()
    assert round_.sum() == pytest.approx(sharp.sum(), rel=1e-4)


def test_nothing_to_press_leaves_the_film_at_rest():
    film = press(np.zeros((4, 7), np.float32), PIXEL)
    assert not film.height.any()
    assert not film.contact.any()


@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (7, 11)])
def test_any_size(size):
    film = press(np.ones(size, np.float32), PIXEL)
    np.testing.assert_allclose(film.height, 1.0, atol=1e-5)


def test_deeper_than_the_object_is_high_is_refused():
    with pytest.raises(InputError, match=r"depth_mm = 8 is more than the object's height"):
        press(*ball(), depth_mm=8.0)
