"""A threshold says where the light is."""

import numpy as np

from tactograph.rings.filters.nodes.threshold import threshold


def test_all_lights_or_any_have_to_exceed_the_level() -> None:
    """A pixel as bright as the level does not count."""
    light = np.array([[[0.2, 0.2, 0.8, 0.5]], [[0.2, 0.8, 0.8, 0.5]]], np.float32)
    assert threshold(light, level=0.5, lights="all").tolist() == [[0, 0, 1, 0]]
    assert threshold(light, level=0.5, lights="any").tolist() == [[0, 1, 1, 0]]
