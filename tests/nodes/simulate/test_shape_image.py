"""Heights from files."""

import cv2
import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.nodes.simulate.shape_image import shape_image

RAMP = np.linspace(0, 1, 12).reshape(3, 4)


@pytest.mark.parametrize(("name", "dtype"), [("a.png", "u1"), ("a.png", "u2"), ("a.tiff", "u2")])
def test_white_is_as_high_as_asked(tmp_path, name, dtype):
    full = np.iinfo(dtype).max
    cv2.imwrite(str(tmp_path / name), (RAMP * full).astype(dtype))
    height, pixel = shape_image(file=tmp_path / name, rise_mm=2.0, pixel_size_mm=0.1)
    np.testing.assert_allclose(height, 2 * RAMP, atol=2 / full)
    assert height.dtype == np.float32
    assert pixel == 0.1


def test_floats_are_millimetres(tmp_path):
    np.save(tmp_path / "a.npy", RAMP - 0.5)
    cv2.imwrite(str(tmp_path / "a.tiff"), (RAMP - 0.5).astype(np.float32))
    for name in ("a.npy", "a.tiff"):
        height = shape_image(file=tmp_path / name).height
        np.testing.assert_allclose(height, np.maximum(RAMP - 0.5, 0), atol=1e-6)


def test_integers_without_a_scale_are_refused(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((2, 2), np.uint8))
    with pytest.raises(InputError, match="what white is"):
        shape_image(file=tmp_path / "a.png")


def test_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        shape_image(file=tmp_path / "a.png")


@pytest.mark.parametrize("name", ["a.png", "a.npy"])
def test_damaged_file_is_refused(tmp_path, name):
    (tmp_path / name).write_bytes(b"what is this")
    with pytest.raises(InputError, match=name):
        shape_image(file=tmp_path / name)


def test_colour_is_refused(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((2, 2, 3), np.uint8))
    with pytest.raises(InputError, match="not grey"):
        shape_image(file=tmp_path / "a.png", rise_mm=1.0)


def test_what_is_not_finite_is_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.full((2, 2), np.nan))
    with pytest.raises(InputError, match="not finite"):
        shape_image(file=tmp_path / "a.npy")
