"""A mask hides what it does not show."""

import numpy as np

from tactograph.rings.mechanics.nodes.marker.mask_image import mask_image


def test_outside_of_the_mask_the_film_is_at_rest() -> None:
    light = np.full((2, 1, 3), 0.3, np.float32)
    mask = np.array([[1, 0, 1]], np.uint8)
    expected = np.float32([[[0.3, 1, 0.3]]] * 2)
    assert np.array_equal(mask_image(light, mask), expected)
    assert light.max() == np.float32(0.3)
