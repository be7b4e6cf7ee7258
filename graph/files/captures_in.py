"""A folder that a user names: one capture, or a folder of captures."""

from __future__ import annotations

from pathlib import Path


def captures_in(folder: Path) -> list[Path]:
    """The folder itself, or, where it holds folders and no file, those in order of name."""
    inside = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    return inside if inside and all(path.is_dir() for path in inside) else [folder]
