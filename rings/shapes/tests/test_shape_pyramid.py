"""A pyramid has plane faces."""

import numpy as np
import pytest

from tactograph.rings.shapes.nodes.shape_pyramid import shape_pyramid


@pytest.mark.parametrize("faces", [3, 4, 6])
def test_every_face_has_the_same_slope(faces):
    height, pixel = shape_pyramid(faces=faces, inradius_mm=4.0, rise_mm=2.0, angle_deg=10.0)
    q, p = np.gradient(height, pixel)
    slope = np.hypot(p, q)[height > 0.3]
    assert np.median(slope) == pytest.approx(0.5, rel=1e-3)
    assert np.mean(np.abs(slope - 0.5) > 0.01) < 0.15  # the ridges


def test_base_is_a_square_of_twice_the_inradius():
    height, pixel = shape_pyramid(faces=4, inradius_mm=4.0)
    assert np.count_nonzero(height) * pixel**2 == pytest.approx(64, rel=0.02)


def test_first_face_looks_along_the_angle():
    height, pixel = shape_pyramid(faces=3, angle_deg=90.0, inradius_mm=3.0, rise_mm=3.0)
    q, _ = np.gradient(height, pixel)
    assert q[140, 160] == pytest.approx(-1, abs=1e-3)
