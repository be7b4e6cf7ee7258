"""The identity of a graph's input files: the hash and header of each."""

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from tactograph.graph.disk.array_files import load_arrays
from tactograph.graph.disk.content_hash import content_hash
from tactograph.graph.errors import one_line

ABOUT_ARRAY = "about"
"""The text array of an ``.npz``: JSON about its other arrays."""
IDENTITY_KEYS = ("sensor", "serial", "date")


def about_in(arrays: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Return a file's header; an empty one if it cannot be read."""
    try:
        head = json.loads(str(arrays[ABOUT_ARRAY]))
    except (KeyError, ValueError, RecursionError):
        return {}
    return head if isinstance(head, dict) else {}


def file_identity(file: Path) -> dict[str, str]:
    """Return hash, sensor, serial and date of an ``.npz``, as far as its header states them.

    Empty for other files, which may be large or change with every item.
    """
    if file.suffix != ".npz" or not file.is_file():
        return {}
    return {"hash": (key := content_hash(file)), **_stated(file, key)}


@cache
def _stated(file: Path, key: str) -> Mapping[str, str]:
    try:
        head = about_in(load_arrays(file, only=ABOUT_ARRAY))
    except (OSError, ValueError):
        return {}
    identity = {name: head.get(name) for name in IDENTITY_KEYS}
    return {
        name: one_line(text) for name, text in identity.items() if isinstance(text, str) and text
    }


def identities(paths: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """Return the identities of the files among a graph's params, except ``out``, by name."""
    return {
        name: identity
        for name, path in paths.items()
        if name != "out" and path is not None and (identity := file_identity(Path(path)))
    }
