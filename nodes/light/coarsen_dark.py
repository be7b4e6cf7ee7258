"""The dark level of a coarser image."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Interval

from tactograph.graph import Parts, Port, node
from tactograph.nodes import F4, Dark
from tactograph.nodes.light.coarsen import coarsen

CoarseDark = Annotated[F4, Port("h w", "1", high=0.05)]


@node(derived={"h": Parts("H", by="factor"), "w": Parts("W", by="factor")})
def coarsen_dark(dark: Dark, *, factor: Annotated[int, Interval(ge=1, le=64)] = 4) -> CoarseDark:
    """Return the mean of every cell of ``factor`` by ``factor`` pixels; see `coarsen`.

    Parameters
    ----------
    dark
        H x W, all LEDs off.
    factor
        Side of a cell in pixels.

    Returns
    -------
    ndarray
        h x w, with h = H / factor and w = W / factor, rounded up.
    """
    return coarsen(dark[None], factor=factor)[0]
