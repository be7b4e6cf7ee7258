"""Find the shadows that a height casts under each LED."""

from __future__ import annotations

from typing import Annotated, Any

import cv2
import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.graph import Flips, SizeLimit, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import F4, Height, Labels, LightPositions, Mask, PixelSize
from tactograph.nodes.optics.bilinear import bilinear
from tactograph.nodes.optics.cache_blocks import in_blocks

GROUP_ITEMS, BLOCK_PX = 64, 16
RAY_STEP_PX = 0.5
"""Along a ray, in px."""
MIN_PLAN_PX = 1e-6


@node(
    tolerance=Flips(2e-3, why="a ray that grazes the surface"),
    sizes={"K": SizeLimit(1, 8, "a label has 8 bits")},
)
def cast_shadows(
    height: Height,
    lights: LightPositions,
    pixel: PixelSize,
    seen: Labels | None = None,
    *,
    reach_px: Annotated[int, Interval(ge=0, le=32)] = 3,
) -> Labels:
    """March from every pixel towards every LED; test whether the surface rises above the ray.

    Labels from the image alone err where a shadow begins, because light is weak there.  The
    shadow that the height casts is sharper, if the height is right.  So both are combined: a
    pixel is in shadow if the height casts one and the image shows one near by.

    Parameters
    ----------
    height
        H x W in mm.
    lights
        K x 3 in mm.
    pixel
        mm per px.
    seen
        H x W, the shadows in the image; without it the height alone decides.
    reach_px
        Largest distance in px, along each axis, at which the image may show the shadow.

    Returns
    -------
    ndarray
        H x W, bit k-1 set where LED k does not light the pixel.
    """
    labels = np.zeros(height.shape, np.uint8)
    window = np.ones((2 * reach_px + 1, 2 * reach_px + 1), np.uint8)
    for k, led in enumerate(lights):
        asked: Mask = np.ones(height.shape, np.uint8)
        if seen is not None:
            asked = np.asarray(cv2.dilate(np.ascontiguousarray(seen >> k & 1), window), np.uint8)
        labels |= _shadow(height, led / np.array([pixel, pixel, 1], np.float32), asked) << k
    return labels


def _shadow(height: F4, led: F4, asked: Mask) -> Mask:
    """1 where the height keeps off the light of an LED (in px and mm); 0 where nobody asked."""
    shadow = np.zeros(height.shape, np.uint8)
    row, column = np.nonzero(asked)

    def cast(part: slice) -> None:
        here = row[part], column[part]
        shadow[here] = _is_blocked(height, led, *here)

    in_blocks(cast, row.size)
    return shadow


def _is_blocked(
    height: F4, led: F4, row: NDArray[np.intp], column: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """Return whether the surface rises above the rays from some pixels to an LED."""
    rows, columns = height.shape
    x, y, z = column.astype(np.float32), row.astype(np.float32), height[row, column]
    dx = led[0] - (x - np.float32(0.5) * (columns - 1))
    dy = led[1] - (y - np.float32(0.5) * (rows - 1))
    plan = np.sqrt(dx * dx + dy * dy) + MIN_PLAN_PX
    ux, uy, climb = dx / plan, dy / plan, (led[2] - z) / plan
    blocked, going, top = np.zeros(row.size, bool), np.arange(row.size), height.max()
    for t in np.arange(RAY_STEP_PX, rows + columns, RAY_STEP_PX, dtype=np.float32):
        px, py, ray = (start[going] + t * by[going] for start, by in ((x, ux), (y, uy), (z, climb)))
        inside = (px >= 0) & (px <= columns - 1) & (py >= 0) & (py <= rows - 1)
        hit = inside & (bilinear(height, px, py) > ray)
        blocked[going[hit]] = True
        going = going[inside & ~hit & (ray < top)]
        if not going.size:
            break
    return blocked


@cast_shadows.opencl()
def _launch(run: Launch) -> None:
    """Find the highest point of the surface, where rays end, and of each block; cast the rays."""
    height, out = run.inputs["height"], run.outputs["cast_shadows"]
    rows, columns = shape = run.sizes["H"], run.sizes["W"]
    top, blocks = run.scratch((1,)), (-(-rows // BLOCK_PX), -(-columns // BLOCK_PX))
    tops, by_rows = run.scratch(blocks), run.in_row_lanes(*shape)
    run.kernel("highest", (GROUP_ITEMS,), height, top, rows * columns, local=(GROUP_ITEMS,))
    run.kernel("block_tops", blocks, height, tops, *shape, *blocks)
    near, reach = run.inputs.get("seen"), int(run.settings["reach_px"])
    if near is not None:
        for axis in (1, 0):
            seen, near = near, run.scratch(shape, np.uint8)
            run.kernel("spread_labels", by_rows, seen, near, *shape, reach, axis)
    lights, pixel = run.inputs["lights"], float(run.inputs["pixel"])
    run.kernel("cast", by_rows, height, lights, near, top, tops, out, *shape, run.sizes["K"], pixel)


@cast_shadows.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """LEDs above the film, and an image that shows shadows here and there."""
    lights = np.column_stack([rng.uniform(-40, 40, (K, 2)), rng.uniform(6, 60, K)])
    sparse = rng.random((H, W)) < 0.02
    seen = np.where(sparse, rng.integers(0, 256, (H, W)), 0)
    return {"lights": lights.astype(np.float32), "seen": seen.astype(np.uint8)}
