"""Write the places or directions of lamps."""

from __future__ import annotations

from pathlib import Path

from tactograph.graph import InputError, node
from tactograph.graph.disk.atomic_files import atomic_file
from tactograph.nodes import LightPositions

LAMPS_HEADING = "lamp,x,y,z"


@node
def write_lamps(lamps: LightPositions, *, file: Path) -> None:
    """Write a table of lamps, a line each, as `read_lamps` reads it.

    Parameters
    ----------
    lamps
        K x 3: x right, y down, z towards the camera; in mm, or of length 1.
    file
        The table; its name ends in ``.csv``.

    Raises
    ------
    InputError
        If the file cannot be written, or is another one than such a table.
    """
    if file.suffix != ".csv" or (file.is_file() and not _is_table(file)):
        raise InputError(f"{file}: is no table of lamps; name another file that ends in .csv")
    rows = (f"led{k},{x:.6g},{y:.6g},{z:.6g}" for k, (x, y, z) in enumerate(lamps, start=1))
    with atomic_file(file) as target:
        target.write_text("\n".join([LAMPS_HEADING, *rows]) + "\n")


def _is_table(file: Path) -> bool:
    with file.open("rb") as opened:
        return opened.read(len(LAMPS_HEADING)) == LAMPS_HEADING.encode()
