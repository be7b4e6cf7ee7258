"""Find the shadows that a height casts under each LED.

An LED at L lights a place P if no place Q between them rises above the ray.  With d the distance in
rows from the LED's foot and z the height, this holds if (L_z - z) / d at P is less than at every Q.
So the running minimum of this ratio along a line away from the LED's foot gives all shadows on that
line.  The lines meet the last row one pixel apart; the minimum at a place between two lines is
interpolated.  Under an LED below the film (`lights_in_view`) the lines are followed towards its
foot.  The plane is cut into four quarters around the LED's foot (down, up, right, left), so
that a line advances by one row, or one column, at a time.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.graph import Close, SizeLimit, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import F4, Height, Labels, LightPositions, PixelSize
from tactograph.nodes.optics.difference import difference

LINES_PER_ITEM = 15
"""Lines that a work-item follows on a CPU, beside the next one for interpolation; 1 on a GPU."""
QUARTER_COUNT = 4
REACH_PX = 3
"""Largest distance between a shadow that the height casts and the image's shadow of that LED."""
MIN_AWAY_PX = np.float32(1e-6)
LEAST_OF_NONE = np.float32(1e30)
"""The minimum before the first row, larger than any ratio."""


@node(
    tolerance=Close(share=2e-3, why="a ray that grazes the surface"),
    sizes={"K": SizeLimit(1, 8, "a label has 8 bits")},
)
def cast_shadows(
    height: Height,
    lights: LightPositions,
    pixel: PixelSize,
    image_labels: Labels | None = None,
    *,
    attached: bool = False,
) -> Labels:
    """Label the pixels whose rays to an LED are blocked by the surface.

    The ray begins one pixel away, so it finds a terminator half a pixel late.  `attached` tests the
    pixel's own slope in addition.

    Labels from the image alone err where a shadow begins, because light is weak there.  The
    shadow that the height casts is sharper, if the height is right.  So both are combined: a
    pixel is shadowed if the height casts a shadow there and the image shows one near by.

    Parameters
    ----------
    height : H x W in mm; beyond the frame nothing casts a shadow
    lights : K x 3 in mm; z < 0: from the opposite direction (`lights_in_view`)
    pixel : mm per px
    image_labels
        H x W, the shadows in the image, which count up to `REACH_PX` away along each axis.  None:
        the height alone decides.
    attached
        Whether surface that faces away from an LED, by central differences, is shadowed too.

    Returns
    -------
    H x W, bit k-1 set where LED k does not light the pixel.
    """
    labels = np.zeros(height.shape, np.uint8)
    window = np.ones((2 * REACH_PX + 1, 2 * REACH_PX + 1), np.uint8)
    y, x = (np.arange(n, dtype=np.float32) - np.float32(0.5) * (n - 1) for n in height.shape)
    for k, (led_x, led_y, led_z) in enumerate(lights):
        across, down = x - led_x / np.float32(pixel), y - led_y / np.float32(pixel)
        dark = np.zeros(height.shape, bool)
        _cast(height, dark, down, across, led_z)
        _cast(height[::-1], dark[::-1], -down[::-1], across, led_z)
        # Pixels on a diagonal belong to the quarters below and above.
        _cast(height.T, dark.T, across, down, led_z, diagonal=False)
        _cast(height.T[::-1], dark.T[::-1], -across[::-1], down, led_z, diagonal=False)
        if attached:
            rises = difference(height, 1) * across + difference(height, 0) * down[:, None]
            dark |= (rises + (led_z - height)) * np.sign(led_z) < 0
        if image_labels is not None:
            dark &= cv2.dilate(np.ascontiguousarray(image_labels >> k & 1), window) > 0
        labels |= dark.astype(np.uint8) << k
    return labels


def _cast(
    height: F4,
    dark: NDArray[np.bool_],
    away: F4,
    aside: F4,
    led_z: np.float32,
    diagonal: bool = True,
) -> None:
    """Mark the shadows in one quarter, whose rows lie ever farther from the LED's foot.

    `away` and `aside` are the distances in px of rows and columns from the foot.
    """
    first = int(np.searchsorted(away, 0))
    height, dark, away = height[first:], dark[first:], np.maximum(away[first:], MIN_AWAY_PX)
    if not away.size:
        return
    rest = np.arange(away.size, dtype=np.float32)[::-1]
    column = np.arange(aside.size, dtype=np.float32)
    # Where the lines through the quarter's corners meet the last row.
    near, far, foot = away[0], away[-1], -aside[0]
    within = np.clip(np.repeat([aside[[0, -1]]], 2, axis=0), [[-near], [-far]], [[near], [far]])
    ends = foot + within + within / [[near], [far]] * rest[[0, -1], None]
    start = np.floor(ends.min()) - 1
    line = np.arange(np.ceil(ends.max()) - start + 2, dtype=np.float32)
    towards, steep = (start + line - foot) / far, led_z / far
    least = np.full(line.size, LEAST_OF_NONE)
    rows = height, dark, away, rest
    order = slice(None, None, -1 if led_z < 0 else 1)
    for z, shadow, d, rest_px in zip(*(each[order] for each in rows), strict=True):
        # The ratio (L_z - z) / d minus its value for level film in the last row, to save digits.
        rise = (steep * rest_px - z) * (far / d)
        place = column + aside * (rest_px / d) - start
        in_beam = np.abs(aside) <= d if diagonal else np.abs(aside) < d
        shadow[in_beam] = np.interp(place[in_beam], line, least) < rise[in_beam]
        at = start + line - towards * rest_px
        inside = (at >= 0) & (at <= column[-1])
        risen = (steep * rest_px - np.interp(at, column, z)) * (far / d)
        np.minimum(least, risen.astype(np.float32), out=least, where=inside)


@cast_shadows.opencl()
def _launch(run: Launch) -> None:
    """Follow the lines of each LED in its own plane, then combine the planes."""
    inputs, sizes = run.inputs, [run.sizes[symbol] for symbol in "HWK"]
    height, width, count = sizes
    dark, by_rows = run.scratch((count, height, width), np.uint8), run.in_row_lanes(height, width)
    # An upper bound for any quarter; work-items beyond its last line return at once.
    lines = LINES_PER_ITEM if run.lanes > 1 else 1
    blocks = -(-(height + width + max(height, width) + 4) // lines)
    work = count * QUARTER_COUNT * blocks
    run.kernel(
        "cast", (work,), inputs["height"], inputs["lights"], dark, *sizes, blocks,
        float(inputs["pixel"]), local=run.alone,
    )  # fmt: skip
    near = inputs.get("image_labels")
    if near is not None:
        for axis in (1, 0):
            in_view, near = near, run.scratch((height, width), np.uint8)
            run.kernel("spread_labels", by_rows, in_view, near, height, width, REACH_PX, axis)
    run.kernel(
        "join", by_rows, dark, near, inputs["height"], inputs["lights"],
        run.outputs["cast_shadows"], *sizes,
        float(inputs["pixel"]), int(run.settings["attached"]),
    )  # fmt: skip


@cast_shadows.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """LEDs above and below the film, and image labels with scattered shadows."""
    lights = np.column_stack([rng.uniform(-40, 40, (K, 2)), rng.uniform(6, 60, K)])
    lights[:, 2] *= rng.choice([1, 1, -1], K)
    sparse = rng.random((H, W)) < 0.02
    in_view = np.where(sparse, rng.integers(0, 256, (H, W)), 0)
    return {"lights": lights.astype(np.float32), "image_labels": in_view.astype(np.uint8)}
