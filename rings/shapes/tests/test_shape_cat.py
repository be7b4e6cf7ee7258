"""The cat is one."""

from functools import cache

import numpy as np
import pytest
from scipy import ndimage

from tactograph.rings.shapes.nodes.shape_cat import shape_cat


@cache
def cat():
    """The usual one, for all tests to look at."""
    return shape_cat()


def test_it_is_one_piece():
    assert ndimage.label(cat().height > 0)[1] == 1


def test_it_has_two_ears_a_face_and_its_tail_on_one_side():
    height, _ = cat()
    top = np.flatnonzero(height.any(1))[0]
    assert ndimage.label(height[top + 6] > 0)[1] == 2
    middle = slice(130, 230)
    left, right = height[middle, :160], height[middle, 160:][:, ::-1]
    assert np.count_nonzero(right) > 1.1 * np.count_nonzero(left)
    # The eyes are dents beside the nose.
    face = height[65:85, 130:190]
    assert face[:, 10:25].min() < face[:, 28:32].max()


def test_length_is_what_was_asked_for():
    height, pixel = shape_cat(length_mm=12.0)
    assert np.ptp(np.flatnonzero(height.any(1))) * pixel == pytest.approx(12, rel=0.03)


@pytest.mark.slow
def test_finer_pixels_show_the_same_cat():
    coarse = cat().height
    fine = shape_cat(width_px=640, height_px=480, pixel_size_mm=1 / 28).height
    binned = fine.reshape(240, 2, 320, 2).mean((1, 3))
    assert np.abs(binned - coarse).mean() < 0.01 * coarse.max()
