"""The film at rest is at height zero."""

import numpy as np
from hypothesis import given, strategies as st

from tactograph.nodes.height.rest_at_border import rest_at_border
from tests.nodes.scenes import ball


@given(offset=st.floats(-5, 5))
def test_any_offset_is_removed(offset: float) -> None:
    height = np.full((30, 40), offset, np.float32)
    height[10:20, 10:20] += 1
    found = rest_at_border(height)
    assert (found[0, 0], found[15, 15]) == (0, height[15, 15] - height[0, 0])


def test_an_object_across_a_third_of_the_border_does_not_lift_it() -> None:
    height = np.zeros((60, 60), np.float32)
    height[:, :15] = 2
    assert rest_at_border(height)[30, 50] == 0


def test_a_frame_narrower_than_the_border_is_all_border() -> None:
    z, _ = ball(4, 5, 50)
    assert np.sort(rest_at_border(z).ravel())[(z.size - 1) // 2] == 0
