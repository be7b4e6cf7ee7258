"""Light that comes from all sides."""

import numpy as np

from tactograph.nodes.simulate.diffuse_gel import diffuse_gel


def test_a_shadow_holds_the_diffused_share_of_the_film_s_light() -> None:
    rest = np.full((4, 5, 6), 0.8, np.float32)
    shadow = np.zeros_like(rest)
    np.testing.assert_allclose(diffuse_gel(shadow, rest, share=0.3), 0.24, rtol=1e-6)


def test_the_film_at_rest_stays_as_bright() -> None:
    rest = np.random.default_rng(0).random((3, 5, 6), np.float32)
    np.testing.assert_allclose(diffuse_gel(rest, rest, share=0.4), rest, rtol=1e-6)


def test_a_clear_gel_changes_nothing() -> None:
    light, rest = np.random.default_rng(0).random((2, 3, 5, 6), np.float32)
    np.testing.assert_array_equal(diffuse_gel(light, rest), light)
