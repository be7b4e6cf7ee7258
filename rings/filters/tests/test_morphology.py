"""What erosion, dilation, opening and closing do to shapes."""

import numpy as np

from tactograph.nodes import U1
from tactograph.rings.filters.nodes.morphology import morphology


def square(side: int) -> U1:
    mask = np.zeros((24, 24), np.uint8)
    mask[8 : 8 + side, 8 : 8 + side] = 1
    return mask


def test_a_square_loses_and_gains_its_rim() -> None:
    eroded = morphology(square(9), operation="erode", radius=2, shape="rect")
    dilated = morphology(square(9), operation="dilate", radius=2, shape="rect")
    assert eroded.sum() == 5 * 5
    assert dilated.sum() == 13 * 13


def test_opening_takes_off_what_is_small_and_closing_fills_what_is_small() -> None:
    speckled, holed = square(9), square(9)
    speckled[2, 2], holed[12, 12] = 1, 0
    assert np.array_equal(morphology(speckled, operation="open", shape="rect"), square(9))
    assert np.array_equal(morphology(holed, operation="close", shape="rect"), square(9))


def test_erosion_is_the_dilation_of_what_is_not_there() -> None:
    mask = np.random.default_rng(1).integers(0, 2, (30, 20), np.uint8)
    eroded = morphology(mask, operation="erode", radius=1)
    assert np.array_equal(eroded, 1 - morphology(1 - mask, operation="dilate", radius=1))
    whole = morphology(np.ones((5, 7), np.uint8), operation="erode", radius=3)
    assert whole.all(), "the frame's border erodes nothing"
