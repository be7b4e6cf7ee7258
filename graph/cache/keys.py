"""Keys of values: hashes of a value's content, or of everything that determines it."""

import hashlib
import itertools
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

_numbers = itertools.count()


def key_of(*parts: Any) -> str:
    """A key of plain data, such as numbers, texts and other keys."""
    return hashlib.blake2b(repr(parts).encode(), digest_size=16).hexdigest()


def content_key(*values: Any) -> str:
    """A key of the content of values, equal for equal numbers, texts and containers.

    The key of any other object is unique each time.
    """
    hashed = hashlib.blake2b(digest_size=16)
    for part in _parts(values):
        hashed.update(part)
    return hashed.hexdigest()


def _parts(value: Any) -> Iterable[Any]:
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        yield f"array {value.dtype.str} {value.shape} ".encode()
        yield np.ascontiguousarray(value).reshape(-1).view(np.uint8)
    elif isinstance(value, dict):
        yield f"dict {len(value)} ".encode()
        for name, each in value.items():
            yield from _parts(name)
            yield from _parts(each)
    elif isinstance(value, tuple | list):
        yield f"{type(value).__name__} {len(value)} ".encode()
        for each in value:
            yield from _parts(each)
    elif value is None or isinstance(value, bool | int | float | str | bytes | np.generic | Path):
        yield f"{type(value).__name__} {value!r} ".encode()
    else:
        yield f"unknown {next(_numbers)} ".encode()
