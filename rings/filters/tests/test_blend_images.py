"""Two exposures mixed."""

import numpy as np
import pytest

from tactograph.rings.filters.nodes.blend_images import blend_images


def test_the_mean_of_two_exposures_has_less_noise_than_each() -> None:
    first, second = 0.5 + 0.01 * np.random.default_rng(1).standard_normal((2, 1, 200, 200)).astype(
        np.float32
    )
    mixed = blend_images(first, second)
    assert mixed.std() == pytest.approx(first.std() / np.sqrt(2), rel=0.03)
    share = blend_images(0 * first, 0 * second + 1, share=0.25)
    assert (share == 0.25).all(), "the share is that of the second"
