"""Captures of other software, whose own file lists their images; a ring reads that file.

A ring's ``captures/NAME.py`` reads folders that hold a ``NAME.yaml``.
"""

from pathlib import Path
from typing import NamedTuple

from tactograph.graph.rings import brought


class ListedCapture(NamedTuple):
    """What the file of a capture states."""

    images: list[Path]
    """In the order of the LEDs."""
    pixel_size: float = 0.0
    """mm per px; 0 where it is unknown."""
    balls: tuple[tuple[float, float, float], ...] = ()
    """x, y and radius in px of balls that were marked by hand."""
    ball_radius: float = 0.0
    """mm; 0 where it is unknown."""


def listed_capture(folder: Path) -> ListedCapture | None:
    """Read the file that lists a capture's images; None if there is none.

    Raises
    ------
    InputError
        If it is damaged, or lists images that are not in its folder.
    """
    for name, reader in brought("captures").items():
        if (folder / f"{name}.yaml").is_file():
            listed: ListedCapture = reader.load().read(folder)
            return listed
    return None
