"""Heights from files."""

import cv2
import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.rings.shapes.nodes.shape_image import shape_image

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


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.png", b"what is this", "a.png"),
        ("a.npy", b"what is this", "a.npy"),
        ("a.png", None, "there is no such file"),
        ("a.png", np.zeros((2, 2), np.uint8), "what white is"),
        ("a.png", np.zeros((2, 2, 3), np.uint8), "not grey"),
        ("a.npy", np.full((2, 2), np.nan), "not finite"),
    ],
)
def test_an_image_without_heights_is_refused(tmp_path, name, content, message):
    file = tmp_path / name
    if isinstance(content, bytes):
        file.write_bytes(content)
    elif content is not None:
        np.save(file, content) if name == "a.npy" else cv2.imwrite(str(file), content)
    with pytest.raises(InputError, match=message):
        shape_image(file=file, rise_mm=1.0 if message == "not grey" else None)
