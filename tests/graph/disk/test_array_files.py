"""The size in an array's header is accepted only if the file is that large."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph.disk import array_files
from tactograph.graph.disk.array_files import load_array, load_arrays

FOUR = np.arange(4, dtype=np.float32)


def boast(shape: tuple[int, ...]) -> bytes:
    """An ``.npy`` whose header promises more than the sixteen bytes that follow."""
    stream = io.BytesIO()
    header = {"descr": "<f4", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(stream, header)
    return stream.getvalue() + FOUR.tobytes()


def test_arrays_are_read_as_they_were_saved(tmp_path: Path) -> None:
    np.save(tmp_path / "one.npy", FOUR)
    np.savez_compressed(tmp_path / "two.npz", a=FOUR, b=FOUR > 1, about=np.array("text"))
    assert np.array_equal(load_array(tmp_path / "one.npy"), FOUR)
    arrays = load_arrays(tmp_path / "two.npz")
    assert np.array_equal(arrays["b"], FOUR > 1)
    assert str(arrays["about"]) == "text"


def test_an_array_larger_than_its_file_or_archive_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "one.npy"
    file.write_bytes(boast((1 << 40,)))
    with pytest.raises(ValueError, match="but the file has only"):
        load_array(file)
    with zipfile.ZipFile(tmp_path / "two.npz", "w") as archive:
        archive.writestr("a.npy", boast((1 << 20, 1 << 20)))
    with pytest.raises(ValueError, match="but the file has only"):
        load_arrays(tmp_path / "two.npz")


def test_an_archive_that_unpacks_to_too_much_is_refused(tmp_path: Path, monkeypatch) -> None:
    np.savez_compressed(tmp_path / "two.npz", a=np.zeros(300_000, np.float32))
    monkeypatch.setattr(array_files, "MAX_BYTES", 1_000_000)
    with pytest.raises(ValueError, match="are allowed"):
        load_arrays(tmp_path / "two.npz")


@pytest.mark.parametrize("content", [b"", b"hello", b"PK\x03\x04" + b"\0" * 40])
def test_a_file_without_an_array_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x").write_bytes(content)
    for load in (load_array, load_arrays):
        with pytest.raises(ValueError, match=r"array|archive|zip|magic|EOF|holds|empty|file"):
            load(tmp_path / "x")
