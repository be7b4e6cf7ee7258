"""Side in pixels of the cells of a coarser image; `cell_side.clh` is the same."""

from typing import Annotated

from annotated_types import Interval

from tactograph.graph import SizeRule

CellSide = Annotated[int, Interval(ge=0, le=64)]
"""Side of a cell in pixels; 0 depends on the image."""
USUAL_SIDE = 4
LARGE_PX = 2 << 20
"""Number of pixels above which an image is large; 1920 x 1080 is not."""


def cell_side(rows: int, columns: int, factor: int) -> int:
    """Return the side in pixels: `factor`, or if that is 0, 4, or 8 for a large image."""
    return factor or (2 * USUAL_SIDE if rows * columns > LARGE_PX else USUAL_SIDE)


def _rows(rows: int, columns: int, factor: int) -> int:
    return -(-rows // cell_side(rows, columns, factor))


def _columns(rows: int, columns: int, factor: int) -> int:
    return -(-columns // cell_side(rows, columns, factor))


def cells_by(parameter: str) -> dict[str, SizeRule]:
    """The sizes h and w of an image's cells, for a node whose `parameter` is a `CellSide`."""
    return {
        "h": SizeRule("H W", by=parameter, rule=_rows),
        "w": SizeRule("H W", by=parameter, rule=_columns),
    }
