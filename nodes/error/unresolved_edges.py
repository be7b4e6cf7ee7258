"""Mark pixels that see both sides of an edge, whose height may be that of either side."""

from typing import Annotated, Any

import numpy as np
from annotated_types import Gt

from tactograph.graph import Close, node
from tactograph.nodes import Blur, Height, Mask, PixelSize
from tactograph.nodes.error._edge_errors import edge_deviation_px, largest_bend


@node(tolerance=Close(share=1e-3, why="a threshold on rounded differences"))
def unresolved_edges(
    height: Height,
    pixel: PixelSize,
    blur: Blur | None = None,
    *,
    resolved_px: Annotated[float, Gt(0)] = 3.0,
) -> Mask:
    """Return 1 where the height may be that of the other side of an edge, else 0.

    At a rim a pixel sees the top, the film below, or both, and its light does not show the share of
    each.  A Gaussian, as in H2, does not describe such a height.  The mark is set on the 3 x 3
    pixels around a pixel whose height departs by more than `resolved_px` from a line through its
    neighbours; soft film does not bend so sharply.  A blurred edge bends less, by the factor by
    which its place is less certain than in a sharp image (`edge_deviation_px`).

    Parameters
    ----------
    height : H x W in mm
    pixel : mm per px
    blur : of the camera in px; None: the camera is sharp
    resolved_px : in pixels of height
    """
    edge = largest_bend(height) * edge_deviation_px(blur or 0.0) / edge_deviation_px(0.0)
    return np.asarray(edge > np.float32(resolved_px) * np.float32(pixel), np.uint8)


unresolved_edges.opencl(grid="H W", lanes="rows")


@unresolved_edges.example
def _example(rng: np.random.Generator, H: int, W: int, **_: int) -> dict[str, Any]:
    """Single heights that stand out by various amounts."""
    height = rng.normal(0, 0.02, (H, W)) + (rng.random((H, W)) < 0.05)
    sizes = {"pixel": float(rng.uniform(0.05, 0.2)), "blur": float(rng.uniform(0, 1))}
    return {"height": height.astype(np.float32), **sizes}
