"""A threshold says where the light is."""

import numpy as np

from tactograph.nodes.filter.threshold import threshold


def test_all_lights_or_any_have_to_exceed_the_level() -> None:
    light = np.array([[[0.2, 0.2, 0.8]], [[0.2, 0.8, 0.8]]], np.float32)
    assert threshold(light, level=0.5, lights="all").tolist() == [[0, 0, 1]]
    assert threshold(light, level=0.5, lights="any").tolist() == [[0, 1, 1]]


def test_a_pixel_as_bright_as_the_level_does_not_count() -> None:
    assert threshold(np.full((1, 1, 1), 0.5, np.float32), level=0.5).tolist() == [[0]]
