"""The side of a pixel on the film, as the user states it."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Interval

from tactograph.graph import node
from tactograph.nodes import PixelSize


@node
def pixel_size(*, mm: Annotated[float, Interval(ge=1e-6, le=1e3)]) -> PixelSize:
    """Return the pixel size, so that nodes can read it like any other value.

    Parameters
    ----------
    mm
        mm per px; from a nanometre to a metre, which files of 32-bit floats can hold.
    """
    return mm
