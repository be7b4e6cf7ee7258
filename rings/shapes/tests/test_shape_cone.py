"""A cone has one slope."""

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.rings.shapes.nodes.shape_cone import shape_cone


def test_slope_is_rise_over_run_all_around():
    height, pixel = shape_cone(radius_mm=5.0, rise_mm=2.0, top_radius_mm=1.0)
    q, p = np.gradient(height, pixel)
    flank = (height > 0.1) & (height < 1.9)
    np.testing.assert_allclose(np.hypot(p, q)[flank], 0.5, rtol=5e-3)


def test_a_cone_holds_a_third_of_its_cylinder():
    height, pixel = shape_cone(radius_mm=5.0, rise_mm=3.0)
    assert height.sum() * pixel**2 == pytest.approx(np.pi * 25, rel=2e-3)


def test_top_wider_than_the_base_is_refused():
    with pytest.raises(InputError, match="make the top narrower"):
        shape_cone(radius_mm=2.0, top_radius_mm=2.0)
