"""Letters stand out of the plane."""

import numpy as np
import pytest
from scipy import ndimage

from tactograph.graph import InputError
from tactograph.rings.shapes.nodes.shape_text import shape_text


def test_holes_of_the_letters_stay_open():
    solid = shape_text(text="O", size_mm=10.0).height > 0
    assert ndimage.label(solid)[1] == 1
    assert ndimage.label(~solid)[1] == 2


def test_tops_are_flat_and_as_high_as_asked():
    height = shape_text(text="I", size_mm=12.0, rise_mm=0.7, bevel_mm=0.2).height
    assert height.max() == pytest.approx(0.7)
    assert np.mean(height[height > 0] == height.max()) > 0.5


def test_bevel_has_its_slope():
    height, pixel = shape_text(text="I", size_mm=12.0, rise_mm=0.6, bevel_mm=0.6)
    flank = np.abs(np.gradient(height[120], pixel))
    assert np.median(flank[flank > 0.5]) == pytest.approx(1, rel=0.05)


def test_text_is_centred_and_not_mirrored():
    height = shape_text(text="L", size_mm=12.0).height
    y, x = np.nonzero(height)
    assert (x.min() + x.max()) / 2 == pytest.approx(159.5, abs=1)
    assert (y.min() + y.max()) / 2 == pytest.approx(119.5, abs=1)
    assert np.count_nonzero(height[:, :160]) > np.count_nonzero(height[:, 160:])
    assert np.count_nonzero(height[120:]) > np.count_nonzero(height[:120])


def test_lines_stand_one_below_the_other():
    height, pixel = shape_text(text="I\nI", size_mm=6.0)
    labels, count = ndimage.label(height > 0)
    centres = ndimage.center_of_mass(height, labels, range(1, count + 1))
    assert count == 2
    assert (centres[1][0] - centres[0][0]) * pixel == pytest.approx(6, abs=0.1)


@pytest.mark.parametrize("text", ["", "  "])
def test_nothing_to_draw_is_refused(text):
    with pytest.raises(InputError, match="nothing to draw"):
        shape_text(text=text)
