"""Find rows that differ from their neighbours more than those of a surface do."""

from typing import Annotated, Any, NamedTuple

import cv2
import numpy as np

from tactograph.graph import Close, Port, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import F4, Light, Mask

REACH_PX = 2
"""Pixels that a fourth difference reads on either side."""


class LineChanges(NamedTuple):
    """Mean fourth differences of the light: across and along each row, and across each column."""

    across_row: Annotated[F4, Port("H", "1")]
    along_row: Annotated[F4, Port("H", "1")]
    across_column: Annotated[F4, Port("W", "1")]


@node(tolerance=Close(1e-4, 1e-3, why="sums in another order"))
def line_changes(light: Light, area: Mask) -> LineChanges:
    """Return how much light changes across and along the rows of pixels, and across columns.

    Film and lens blur a surface in all directions.  Only an image whose rows do not belong together
    changes far more from row to row than along a row: one that is interlaced or torn, or has dead
    rows (T5).

    Parameters
    ----------
    light : K x H x W, relative to the film at rest
    area : H x W, 1 where the frame shows film; pixels near the edge of that area are left out
    """
    side = 2 * REACH_PX + 1
    counts = cv2.erode(area, cv2.getStructuringElement(cv2.MORPH_CROSS, (side, side)))
    down, right = ((_fourth(light, axis) * counts).sum(axis=0) for axis in (1, 2))
    rows, columns = (np.maximum(len(light) * counts.sum(axis=axis), 1) for axis in (1, 0))
    sums = down.sum(axis=1) / rows, right.sum(axis=1) / rows, right.sum(axis=0) / columns
    return LineChanges(*(np.asarray(mean, np.float32) for mean in sums))


def _fourth(light: Light, axis: int) -> F4:
    """The fourth difference along an axis; borders repeat."""
    wide = np.pad(light, [(REACH_PX * (a == axis),) * 2 for a in range(light.ndim)], "edge")
    return np.abs(np.diff(wide, 2 * REACH_PX, axis))


@line_changes.opencl()
def _launch(run: Launch) -> None:
    inputs = run.inputs["light"], run.inputs["area"]
    across, along, columns = run.outputs.values()
    count, height, width = (run.sizes[name] for name in "KHW")
    run.kernel("rows", (height,), *inputs, across, along, count, height, width)
    run.kernel("columns", run.in_lanes(width), *inputs, columns, count, height, width)


@line_changes.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """Noise on ripples, with every third row displaced, and some pixels that show no film."""
    light = 1 + 0.2 * np.sin(np.arange(W) / 5) + rng.normal(0, 0.01, (K, H, W))
    light[:, ::3] += 0.1
    return {"light": light.astype(np.float32), "area": (rng.random((H, W)) < 0.98).astype(np.uint8)}
