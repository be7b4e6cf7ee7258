"""Increase the variance of slopes at edges that cast shadows, since the height may jump there."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.graph import Close, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import F4, Labels, Light, LightPositions, PixelSize, SlopeVariance
from tactograph.nodes.optics.bilinear import mask_at
from tactograph.nodes.optics.rays import rays_towards

JUMP_SLOPE = np.float32(3)
"""Standard deviation of the slope across an edge, per light above `GRAZING_LIGHT`."""
GRAZING_LIGHT = np.float32(0.3)
"""Light up to which a smooth film may be turning away from an LED."""


@node(
    neutral="variance",
    tolerance=Close(
        0, 1e-5, share=1e-3, why="a rounded direction chooses the neighbour away from an LED"
    ),
)
def cliff_variance(
    variance: SlopeVariance,
    light: Light,
    shadow: Labels,
    lights: LightPositions,
    pixel: PixelSize,
) -> SlopeVariance:
    """Add (3 max(m - 0.3, 0))^2 at a pixel of light m if the next pixel away from the LED is dark.

    Where the shadow of a round body begins, light grazes it: m is close to 0, apart from
    diffused light and noisy labels.  A sharp edge is well lit there, and no slope shows the
    step behind it (equation W2).  The largest m over the LEDs and over 3 x 3 pixels counts,
    because a step lies between two pixels.

    Parameters
    ----------
    variance : 2 x H x W
    light : K x H x W, 1 on the film at rest
    shadow : H x W, the shadowed LEDs
    lights : K x 3 in mm; z < 0: from the opposite direction (`lights_in_view`)
    pixel : mm per px
    """
    cliff = np.zeros(shadow.shape, np.float32)
    for k, plane in enumerate(light):
        dark = np.asarray(shadow >> k & 1, np.uint8)
        row, column = _before_dark(dark, lights[k] / np.float32(pixel))
        cliff[row, column] = np.maximum(cliff[row, column], plane[row, column])
    largest = cv2.dilate(cliff, np.ones((3, 3), np.uint8))
    step = JUMP_SLOPE * np.maximum(largest - GRAZING_LIGHT, np.float32(0))
    return np.asarray(variance + step * step, np.float32)


def _before_dark(dark: Labels, led: F4) -> tuple[NDArray[np.intp], ...]:
    """The lit pixels whose neighbour away from the LED is dark; `led` is in px from the centre.

    The neighbour is one of eight.
    """
    around = np.argwhere(cv2.dilate(dark, np.ones((3, 3), np.uint8)) > dark)
    y, x = around.T.astype(np.float32)
    rays = rays_towards(led, x, y, dark.shape)
    row, column = around[mask_at(dark > 0, *rays.at(np.float32(-1)))].T
    return row, column


@cliff_variance.opencl()
def _launch(run: Launch) -> None:
    """Find the cliff at each pixel, then the largest within 3 x 3 pixels."""
    inputs, (lights, rows, columns) = run.inputs, (run.sizes[symbol] for symbol in "KHW")
    cliffs, grid = run.scratch((rows, columns)), run.in_row_lanes(rows, columns)
    run.kernel(
        "find_cliffs", grid,
        inputs["light"], inputs["shadow"], inputs["lights"], cliffs,
        lights, rows, columns, inputs["pixel"],
    )  # fmt: skip
    out, rules = run.outputs["cliff_variance"], (JUMP_SLOPE, GRAZING_LIGHT)
    run.kernel("add_steps", grid, inputs["variance"], cliffs, out, rows, columns, *rules)


@cliff_variance.example
def _example(rng: np.random.Generator, H: int, W: int, **_: int) -> dict[str, Any]:
    """Shadows here and there, so that some cliffs are alone in their neighbourhood."""
    sparse = rng.random((H, W)) < 0.05
    return {"shadow": np.where(sparse, rng.integers(0, 256, (H, W)), 0).astype(np.uint8)}
