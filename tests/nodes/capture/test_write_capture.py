"""A capture is written completely, or an error says why it is not."""

import errno
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from tactograph import nodes
from tactograph.graph.errors import WriteError
from tactograph.nodes.capture.read_capture import read_capture
from tactograph.nodes.capture.write_capture import write_capture
from tactograph.nodes.files.image_files import ImageFile, Lights

LIGHT, LEVEL = np.full((4, 6, 8), 0.5, np.float32), np.zeros((6, 8), np.float32)


def write(folder: Path) -> None:
    write_capture(
        LIGHT, LEVEL, np.zeros((2, 6, 8), np.float32), 0.1, LEVEL.astype(np.uint8), np.ones((4, 3)),
        folder=folder,
    )  # fmt: skip


def test_an_image_is_read_as_it_was_written(tmp_path: Path) -> None:
    image = np.random.default_rng(0).integers(0, 65535, (6, 8, 3)).astype(np.uint16)
    ImageFile(tmp_path / "a.png").write(image)
    assert np.array_equal(ImageFile(tmp_path / "a.png").read(), image)


def test_a_full_disk_leaves_no_capture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(file: Path, data: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    # OpenCV reports it by returning False.
    monkeypatch.setattr(cv2, "imwrite", lambda *_: False)
    with pytest.raises(WriteError, match="cannot be written: No space left on device"):
        write(tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_no_node_ignores_a_failed_write_of_an_image() -> None:
    """`cv2.imwrite` reports a failure only by its return value."""
    files = Path(nodes.__path__[0]).rglob("*.py")
    assert not [f.name for f in files if re.search(r"cv2\.imwrite\(", f.read_text("utf-8"))]


@pytest.mark.parametrize("order", ["bgr", "rgb"])
def test_colours_are_one_picture_that_is_read_back(tmp_path: Path, order: Lights) -> None:
    counts = np.arange(3 * 8 * 12).reshape(3, 8, 12) % 200 + 20
    image, flat = (counts / 255).astype(np.float32), np.zeros((8, 12), np.float32)
    write_capture(image, flat, np.stack([flat, flat]), 0.1, folder=tmp_path, order=order)
    assert (tmp_path / "touch.png").is_file()
    (capture,) = read_capture(folder=tmp_path, lights=order)
    np.testing.assert_allclose(capture.image, image, atol=1e-6)
