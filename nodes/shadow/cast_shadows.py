"""Find the shadows that a height casts under each LED."""

from __future__ import annotations

from typing import Annotated, Any

import cv2
import numpy as np
from annotated_types import Interval

from tactograph.graph import Flips, SizeLimit, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import F4, Height, Labels, LightPositions, Mask, PixelSize
from tactograph.nodes.light._cache_blocks import in_blocks
from tactograph.nodes.light._only_read import only_read

GROUP, BLOCK = 64, 16


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
    from tactograph.nodes.shadow._ray_loops import cast

    out = np.zeros(height.shape, np.uint8)
    window = np.ones((2 * reach_px + 1, 2 * reach_px + 1), np.uint8)
    surface, top = only_read(height), height.max()
    size = np.float32(pixel)
    for k, (x, y, z) in enumerate(lights):
        asked: Mask = np.ones(height.shape, np.uint8)
        if seen is not None:
            asked = np.asarray(cv2.dilate(np.ascontiguousarray(seen >> k & 1), window), np.uint8)
        led = np.array([x / size, y / size, z], np.float32)

        def cast_in(rows: slice, led: F4 = led, asked: Mask = asked, bit: int = 1 << k) -> None:
            cast(rows.start, rows.stop, surface, led, asked, top, bit, out)

        in_blocks(cast_in, *height.shape)
    return out


@cast_shadows.opencl()
def _launch(run: Launch) -> None:
    """Find the highest point of the surface, where rays end, and of each block; cast the rays."""
    height, out = run.inputs["height"], run.outputs["cast_shadows"]
    rows, columns = shape = run.sizes["H"], run.sizes["W"]
    top, blocks = run.scratch((1,)), (-(-rows // BLOCK), -(-columns // BLOCK))
    tops, by_rows = run.scratch(blocks), run.in_row_lanes(*shape)
    run.kernel("highest", (GROUP,), height, top, rows * columns, local=(GROUP,))
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
