"""A staircase has levels."""

import numpy as np
import pytest

from tactograph.rings.shapes.nodes.shape_steps import shape_steps


def test_levels_are_the_multiples_of_the_step_each_of_the_same_area():
    height, pixel = shape_steps(count=4, tread_mm=2.0, step_mm=0.4, breadth_mm=10.0)
    levels, pixels = np.unique(height, return_counts=True)
    np.testing.assert_allclose(levels, 0.4 * np.arange(5), rtol=1e-6)
    np.testing.assert_allclose(pixels[1:] * pixel**2, 20, rtol=0.05)


def test_it_climbs_along_the_angle():
    right, down = (shape_steps(angle_deg=a).height for a in (0.0, 90.0))
    assert (np.diff(right[120, 110:210]) >= 0).all()
    assert (np.diff(down[70:170, 160]) >= 0).all()
    assert right.max() == pytest.approx(1.6)


def test_walls_of_an_angle_have_its_slope_and_keep_the_levels():
    height, pixel = shape_steps(count=3, tread_mm=3.0, step_mm=0.4, wall_deg=30.0)
    profile = height[120]
    assert np.abs(np.diff(profile)).max() / pixel <= np.tan(np.radians(30)) * 1.001
    middles = [round(160 + at / pixel) for at in (-3.0, 0.0, 3.0)]
    np.testing.assert_allclose(profile[middles], [0.4, 0.8, 1.2], atol=1e-6)
