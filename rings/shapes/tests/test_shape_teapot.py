"""The teapot is one."""

import numpy as np
import pytest
from scipy import ndimage

from tactograph.rings.shapes.nodes.shape_teapot import shape_teapot


def test_it_is_one_piece_with_a_hole_through_the_handle():
    solid = shape_teapot().height > 0
    assert ndimage.label(solid)[1] == 1
    assert ndimage.label(~solid)[1] == 2


def test_length_is_what_was_asked_for():
    height, pixel = shape_teapot(length_mm=12.0)
    columns = np.flatnonzero(height.any(0))
    assert np.ptp(columns) * pixel == pytest.approx(12, rel=0.03)


def test_rise_scales_the_height_alone():
    plain, low = shape_teapot().height, shape_teapot(rise_mm=1.5).height
    assert low.max() == pytest.approx(1.5, rel=1e-5)
    np.testing.assert_allclose(low / low.max(), plain / plain.max(), atol=1e-5)


def test_turned_by_half_a_circle_it_is_the_same_upside_down():
    plain, turned = shape_teapot().height, shape_teapot(angle_deg=180.0).height
    np.testing.assert_allclose(turned, plain[::-1, ::-1], atol=2e-2)
