"""The film at rest that a calibration keeps: without ambient light, at the camera's resolution."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.calibrate.rest.full_rest import full_rest

AMBIENT = np.float32(0.05)
LIT: F4 = np.linspace(0.3, 0.8, 2 * 8 * 10, dtype=np.float32).reshape(2, 8, 10)
TAKEN: F4 = LIT + AMBIENT
BLACK: F4 = np.zeros((8, 10), np.float32)


def binned(step: int) -> tuple[F4, F4]:
    """The binned flat frame without ambient light, and the ambient light, as calibrated."""
    return LIT[:, ::step, ::step] * 1.01, np.full_like(BLACK[::step, ::step], AMBIENT)


def test_at_the_same_size_the_calibrated_frames_are_kept() -> None:
    flat, dark = binned(1)
    rest = full_rest(TAKEN, BLACK, flat, dark)
    np.testing.assert_array_equal(rest.flat, flat)
    np.testing.assert_array_equal(rest.dark, dark)


@pytest.mark.parametrize("step", [1, 2])
def test_as_taken_the_flat_frame_is_kept_without_ambient_light(step: int) -> None:
    rest = full_rest(TAKEN, BLACK, *binned(step), as_taken=True)
    np.testing.assert_allclose(rest.flat, LIT, atol=1e-6)
    np.testing.assert_allclose(rest.dark, AMBIENT, atol=1e-6)


@pytest.mark.parametrize("as_taken", [False, True])
def test_without_a_flat_frame_the_model_is_enlarged(as_taken: bool) -> None:
    rest = full_rest(np.ones_like(LIT), BLACK, *binned(2), as_taken=as_taken)
    assert rest.flat.shape == LIT.shape
    assert np.abs(rest.flat - LIT).max() < 0.08
