"""Shadows' rises above the film at rest."""

from typing import Any

import numpy as np

from tactograph.graph import node
from tactograph.nodes import Height, ShadowRises


@node
def rises_from_rest(rises: ShadowRises, rest: Height | None = None) -> ShadowRises:
    """Subtract from each rise that of the film at rest between the same two pixels.

    Parameters
    ----------
    rises : as `shadow_constraints` returns them
    rest : H x W in mm, the seen height of the film at rest; None: a plane
    """
    if rest is None or not rises.rise.size:
        return rises
    low = rest.ravel()
    rise = rises.rise - (low[rises.top] - low[rises.foot])
    return rises._replace(rise=np.asarray(rise, np.float32))


rises_from_rest.opencl(grid="C")


@rises_from_rest.example
def _example(rng: np.random.Generator, C: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """Rises between pixels of the frame."""
    top, foot = rng.integers(0, H * W, (2, C)).astype(np.int32)
    return {"rises.top": top, "rises.foot": foot}
