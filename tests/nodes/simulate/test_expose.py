"""The effect of a camera on light."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from tactograph.nodes.simulate.expose import expose

SILENT = {"shot_noise": False, "read_noise": 0.0}


def flat(level, size=(3, 64, 64)):
    return np.full(size, level, np.float32)


@given(bits=st.integers(1, 16), level=st.floats(0, 2))
def test_image_is_a_whole_number_of_steps_and_within_half_a_step(bits, level):
    image = expose(flat(level, (3, 2, 2)), bits=bits, **SILENT).image
    steps = image.astype(float) * (2**bits - 1)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-2)
    assert np.abs(image - min(level, 1)).max() <= 0.5 / (2**bits - 1) + 1e-6


def test_same_seed_same_image_other_seed_or_light_other_noise():
    a, b, c = (expose(flat(0.5), seed=s).image for s in (7, 7, 8))
    np.testing.assert_array_equal(a, b)
    assert np.mean(a != c) > 0.3
    assert np.mean(a[0] != a[1]) > 0.3


@pytest.mark.parametrize("level", [0.05, 0.3, 0.8])
def test_shot_noise_is_the_square_root_of_the_electrons(level):
    image = expose(flat(level), full_well=10000.0, read_noise=0.0, bits=16).image
    assert image.mean() == pytest.approx(level, rel=5e-3)
    assert image.std() == pytest.approx(np.sqrt(level / 10000), rel=0.05)


@pytest.mark.parametrize("level", [0.3, 0.8])
def test_read_noise_does_not_depend_on_the_light(level):
    silent = {"shot_noise": False, "read_noise": 8.0}
    image = expose(flat(level), full_well=1000.0, bits=16, **silent).image
    assert image.std() == pytest.approx(0.008, rel=0.05)


def test_dark_image_holds_the_ambient_light_alone_and_too_much_light_is_clipped():
    exposed = expose(flat(0.5), ambient=0.1, bits=16, **SILENT)
    np.testing.assert_allclose(exposed.dark, 0.1, atol=1e-4)
    np.testing.assert_allclose(exposed.image, 0.6, atol=1e-4)
    assert expose(flat(0.5), **SILENT).dark.max() == 0
    assert (expose(flat(3.0)).image == 1).all()


def test_lens_loses_the_stated_share_in_the_corners_and_nothing_in_the_middle():
    image = expose(flat(0.8, (3, 41, 61)), vignetting=0.25, bits=16, **SILENT).image
    assert image[0, 20, 30] == pytest.approx(0.8, abs=1e-4)
    np.testing.assert_allclose(image[:, [0, 0, -1, -1], [0, -1, 0, -1]], 0.6, atol=1e-4)
    np.testing.assert_array_equal(image, image[:, ::-1, ::-1])
    alone = expose(flat(0.5, (1, 1, 1)), vignetting=0.5, **SILENT).image
    np.testing.assert_allclose(alone, 0.5, atol=0.5 / 255)
