"""Read NumPy files without pickle, and without trusting the sizes in their headers."""

import math
import zipfile
from pathlib import Path
from typing import IO, Any

from numpy.lib import format as npy
from numpy.typing import NDArray

ZIP_MAGIC = b"PK\x03\x04"
MAX_BYTES = 2**30
"""Largest size of a file's arrays after unpacking."""


def load_array(file: Path) -> NDArray[Any]:
    """Read an ``.npy``.

    Raises OSError if it cannot be read; ValueError if it is not an array of numbers, holds a
    pickle, or is shorter than its header states.
    """
    with file.open("rb") as stream:
        if stream.read(len(ZIP_MAGIC)) == ZIP_MAGIC:
            raise ValueError("it holds several arrays; one is needed")
        return _checked(stream, file.stat().st_size)


def load_arrays(file: Path, only: str | None = None) -> dict[str, NDArray[Any]]:
    """Read an ``.npz``, or only its array `only`, if it has one.

    Raises OSError if it cannot be read; ValueError if it is damaged, holds a pickle, or unpacks to
    more than `MAX_BYTES`.
    """
    arrays: dict[str, NDArray[Any]] = {}
    try:
        with zipfile.ZipFile(file) as archive:
            unpacked = sum(member.file_size for member in archive.infolist())
            if unpacked > MAX_BYTES:
                raise ValueError(f"its arrays are {unpacked} bytes, {MAX_BYTES} are allowed")
            for member in archive.infolist():
                name = member.filename.removesuffix(".npy")
                if only not in (None, name):
                    continue
                if name in arrays:
                    raise ValueError(f"it holds '{name}' twice")
                with archive.open(member) as stream:
                    arrays[name] = _checked(stream, member.file_size)
    except (OSError, ValueError, MemoryError):
        raise
    except Exception as error:  # a damaged archive fails anywhere inside zipfile and zlib
        raise ValueError(f"{error}") from None
    return arrays


def _checked(stream: IO[bytes], size: int) -> NDArray[Any]:
    """Read an array from a stream of `size` bytes if its header fits them."""
    stream.seek(0)
    version = npy.read_magic(stream)
    if version not in ((1, 0), (2, 0), (3, 0)):
        raise ValueError(f"its format {version} is unknown")
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read(stream)
    if dtype.hasobject:
        raise ValueError("it holds a pickle")
    if any(side < 0 for side in shape) or math.prod(shape) * dtype.itemsize > size:
        raise ValueError(f"its header declares {shape}, but the file has only {size} bytes")
    stream.seek(0)
    return npy.read_array(stream, allow_pickle=False)
