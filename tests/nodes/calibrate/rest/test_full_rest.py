"""The film at rest that a calibration keeps: without ambient light, at the camera's resolution."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.calibrate.rest.full_rest import full_rest

AMBIENT = np.float32(0.05)
LIT: F4 = np.linspace(0.3, 0.8, 2 * 8 * 10, dtype=np.float32).reshape(2, 8, 10)
TAKEN: F4 = LIT + AMBIENT
BLACK: F4 = np.zeros((8, 10), np.float32)


def found(step: int) -> tuple[F4, F4]:
    """What the calibration found on bins: no markers, no ambient light; and that light."""
    return LIT[:, ::step, ::step] * 1.01, np.full_like(BLACK[::step, ::step], AMBIENT)


def test_at_the_same_size_it_is_what_the_calibration_found() -> None:
    flat, dark = found(1)
    kept = full_rest(TAKEN, BLACK, flat, dark)
    np.testing.assert_array_equal(kept.flat, flat)
    np.testing.assert_array_equal(kept.dark, dark)


@pytest.mark.parametrize("step", [1, 2])
def test_as_taken_it_is_the_flat_frame_itself_less_ambient_light(step: int) -> None:
    kept = full_rest(TAKEN, BLACK, *found(step), as_taken=True)
    np.testing.assert_allclose(kept.flat, LIT, atol=1e-6)
    np.testing.assert_allclose(kept.dark, AMBIENT, atol=1e-6)


@pytest.mark.parametrize("as_taken", [False, True])
def test_where_no_flat_frame_was_taken_it_is_the_model_enlarged(as_taken: bool) -> None:
    kept = full_rest(np.ones_like(LIT), BLACK, *found(2), as_taken=as_taken)
    assert kept.flat.shape == LIT.shape
    assert np.abs(kept.flat - LIT).max() < 0.08
