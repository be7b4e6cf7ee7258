"""Presses on a sheet: P captures of H rows, stacked to one picture of S = P H rows.

Steps that treat pixels independently (labels, tables, fits) take a sheet like a capture; a sheet of
one press is that capture.  Only steps that depend on a pixel's position on the film have to cut the
sheet.
"""

from typing import Annotated, Any

from numpy.typing import NDArray

from tactograph.graph import Port
from tactograph.nodes import F4, U1

SheetLight = Annotated[F4, Port("K S W", "1")]
SheetSlope = Annotated[F4, Port("2 S W", "mm/mm", low=-2, high=2)]
SheetHeight = Annotated[F4, Port("S W", "mm", low=-1, high=5)]
SheetMask = Annotated[U1, Port("S W", "flag", high=1)]
SheetLabels = Annotated[U1, Port("S W", "LED bits", high=255)]


def cut(sheet: NDArray[Any], rows: int) -> list[NDArray[Any]]:
    """Return the presses of a sheet (... x S x W), each of `rows` rows: views, not copies."""
    return [sheet[..., at : at + rows, :] for at in range(0, sheet.shape[-2], rows)]
