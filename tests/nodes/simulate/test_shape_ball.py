"""Balls of known radius."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tactograph.graph import InputError
from tactograph.nodes.simulate.shape_ball import shape_ball


def test_papers_ball_of_5_mm_is_70_pixels_high():
    height, pixel = shape_ball(radius_mm=5.0)
    assert height.shape == (240, 320)
    assert height.dtype == np.float32
    assert height.max() / pixel == pytest.approx(70, abs=0.01)


@given(radius=st.floats(0.5, 7), share=st.floats(0.05, 1))
def test_footprint_is_the_circle_that_the_plane_cuts_out(radius, share):
    rise = radius * share
    height, pixel = shape_ball(radius_mm=radius, rise_mm=rise)
    footprint = np.sqrt(np.count_nonzero(height) / np.pi) * pixel
    assert footprint == pytest.approx(np.sqrt(rise * (2 * radius - rise)), abs=0.5 * pixel)
    assert height.max() <= rise + 1e-6


def test_the_volume_is_that_of_a_hemisphere():
    height, pixel = shape_ball(radius_mm=7.0)
    assert height.sum() * pixel**2 == pytest.approx(2 / 3 * np.pi * 7**3, rel=1e-3)


def test_a_complete_ball_lies_on_the_plane():
    height, _ = shape_ball(radius_mm=3.0, rise_mm=6.0)
    assert height.max() == pytest.approx(6, abs=1e-3)
    assert height[height > 0].min() > 3


def test_offset_moves_the_top_right_and_down():
    height, pixel = shape_ball(radius_mm=3.0, offset_mm=(2.0, 1.0))
    y, x = np.unravel_index(np.argmax(height), height.shape)
    assert (x - 159.5) * pixel == pytest.approx(2, abs=pixel)
    assert (y - 119.5) * pixel == pytest.approx(1, abs=pixel)


def test_top_above_the_ball_is_refused():
    with pytest.raises(InputError, match="more than the ball's diameter 6"):
        shape_ball(radius_mm=3.0, rise_mm=7.0)
