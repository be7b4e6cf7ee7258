"""A folder that a user names: one capture, or a folder of captures."""

from pathlib import Path

from tactograph.graph.errors import InputError, missing

CAPTURE_PARAM = "capture"
"""The param of a graph that takes a capture's folder."""


def captures_in(folder: Path) -> list[Path]:
    """The folder itself; if it holds folders but no file, these folders sorted by name.

    Raises InputError if there is no such folder.
    """
    if not folder.exists():
        raise InputError(missing(folder, "folder"))
    inside = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    return inside if inside and all(path.is_dir() for path in inside) else [folder]
