"""Where a pixel sees two sides of an edge, and its height is that of one of them."""

from typing import Annotated, Any

import numpy as np
from annotated_types import Gt

from tactograph.graph import Flips, node
from tactograph.nodes import Blur, Height, Mask, PixelSize
from tactograph.nodes.error._edge_errors import edge_deviation_px, largest_bend


@node(tolerance=Flips(1e-3, why="a threshold on rounded differences"))
def unresolved_edges(
    height: Height,
    pixel: PixelSize,
    blur: Blur | None = None,
    *,
    resolved_px: Annotated[float, Gt(0)] = 3.0,
) -> Mask:
    """Return 1 where the height may as well be that of the other side of an edge, else 0.

    At a rim a pixel sees the top, the film below, or both, and its light does not tell which
    share it has of each.  One Gaussian, as that of H2, does not describe such a height.  The mark
    is set on all 3 x 3 pixels around one whose height departs by more than `resolved_px` from a
    line through its neighbours; soft film does not bend so sharply.  A blurred edge bends less, by
    as much as its place is less certain than in a sharp image (`edge_deviation_px`).

    Parameters
    ----------
    height : H x W in mm
    pixel : mm per px
    blur : px, of the camera; without it the camera is sharp
    resolved_px : in pixels of height
    """
    edge = largest_bend(height) * edge_deviation_px(blur or 0.0) / edge_deviation_px(0.0)
    return np.asarray(edge > np.float32(resolved_px) * np.float32(pixel), np.uint8)


unresolved_edges.opencl(grid="H W", lanes="rows")


@unresolved_edges.example
def _example(rng: np.random.Generator, H: int, W: int, **_: int) -> dict[str, Any]:
    """Single heights that stand out, and by how much."""
    height = rng.normal(0, 0.02, (H, W)) + (rng.random((H, W)) < 0.05)
    sizes = {"pixel": float(rng.uniform(0.05, 0.2)), "blur": float(rng.uniform(0, 1))}
    return {"height": height.astype(np.float32), **sizes}
