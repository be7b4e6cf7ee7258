"""What a scan of a step of known depth settles: the scale of heights, and a part of their error."""

from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from tactograph.rings.metrology.nodes.filled.scale_height import StepScale
from tactograph.rings.metrology.nodes.surface.measure_step import (
    Across,
    CertifiedDepth,
    EdgeCount,
    ErrorParts,
    depths_with,
    measure_step,
    parts_within,
)
from tactograph.sdk import F4, Crop, Height, InputError, Layout, PixelSize, Port, node, warn

USUAL_STEP_SCALE, MAX_STEP_SCALE = 1.08, 1.25
"""Factors by which a known step is deeper or shallower than a light model makes it: one that films
rarely reach (they reached 1.06), and one above which it is another step."""


class ScaleStep(NamedTuple):
    """What a step of known depth says of other scans."""

    scale: StepScale
    errors: Annotated[F4, Port("E", "1", low=-0.01, high=0.01)]
    """What its depth errs by in each part of the error, as a share of it."""
    metrics: dict[str, float]


@node
def scale_step(
    height: Height,
    parts: ErrorParts,
    pixel: PixelSize,
    light: dict[str, float],
    *,
    folder: Path | None = None,
    certified_um: CertifiedDepth | None = None,
    crop: Crop | None = None,
    along: Across = "x",
    edges: EdgeCount = 2,
) -> ScaleStep:
    """Compare the depth of a step, reconstructed as any other scan, with the certified one.

    Balls leave open what radius, brightness of touched film and light model do to all slopes.  A
    step tells it.  Whatever the model gets wrong about a normal and a place it gets wrong for
    step and specimen alike, so each part of a height's error (`level_scan`) goes with one of the
    step's depth, and what both share is settled.

    Parameters
    ----------
    height : H x W in mm, of the step
    parts : E x h x w, the parts of its error
    pixel : mm per px
    light : figures of `judge_light_model` on the step's scan
    folder : the step's scan, which messages name
    certified_um, along, edges : as for `measure_step`
    crop : x0, y0, x1, y1 in pixels, the part that shows one step

    Returns
    -------
    ScaleStep
        2, E, and ``known_scale``, ``known_scale_error``, ``known_residual``.

    Raises
    ------
    InputError
        As `measure_step`; if no depth is given, or the step found is another one.
    """
    if folder is None or certified_um is None:
        raise InputError("a known step needs both: `folder`=SCAN `certified_um`=DEPTH,UNCERTAINTY")
    shown_height = np.ascontiguousarray(Layout(crop=crop).cropped(height, folder))
    cells = parts_within(parts, crop, height.shape)
    try:
        step = measure_step(
            shown_height,
            pixel,
            0 * shown_height,
            along=along,
            edges=edges,
            certified_um=certified_um,
        )
        depth, *others = depths_with(cells, shown_height, pixel, along, edges)
    except InputError as error:
        raise InputError(f"{folder}: {error}") from None
    scale = step["step_scale"], step["step_scale_error"]
    ratio = max(scale[0], 1 / scale[0])
    if ratio > USUAL_STEP_SCALE:
        message = (
            f"{folder}: its step is {abs(step['step_depth_um']):.3g} um deep, not "
            f"{certified_um[0]:g}: check `certified_um`, and that `crop` shows this step alone"
        )
        if ratio > MAX_STEP_SCALE:
            raise InputError(message)
        warn(message)
    shares = np.array(others, np.float32) / np.float32(depth) - 1
    scale_params = dict(zip(("known_scale", "known_scale_error"), scale, strict=True))
    scale_params["known_residual"] = light["model_residual"]
    return ScaleStep(np.array(scale, np.float32), shares, scale_params)
