"""Light that comes from all sides."""

import numpy as np

from tactograph.nodes.simulate.diffuse_gel import diffuse_gel


def test_a_shadow_holds_the_diffused_share_of_the_film_s_light() -> None:
    """The film at rest stays as bright, and a clear gel changes nothing."""
    light, rest = np.random.default_rng(0).random((2, 3, 5, 6), np.float32)
    np.testing.assert_allclose(diffuse_gel(0 * rest, rest, share=0.3), 0.3 * rest, rtol=1e-6)
    np.testing.assert_allclose(diffuse_gel(rest, rest, share=0.4), rest, rtol=1e-6)
    np.testing.assert_array_equal(diffuse_gel(light, rest), light)
