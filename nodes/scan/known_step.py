"""What a scan of a step of known depth settles: the scale of heights, and a part of their error."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval

from tactograph.graph import InputError, NodeCall, node
from tactograph.nodes import PixelSize
from tactograph.nodes.capture.read_capture import read_capture
from tactograph.nodes.files.image_files import Crop, cropped
from tactograph.nodes.height.enlarge_height import enlarge_height
from tactograph.nodes.height.integrate_dct import integrate_dct
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.metrology.measure_step import KnownDepth, mean_depths, measure_step
from tactograph.nodes.metrology.scale_height import Scale
from tactograph.nodes.optics.cell_side import CellSide
from tactograph.nodes.optics.light_model import LightModel
from tactograph.nodes.scan._scan_error import scan_errors
from tactograph.nodes.scan._scan_levelling import ScanLevelling
from tactograph.nodes.scan.judge_light_model import judge_light_model
from tactograph.nodes.scan.level_scan import KnownStep
from tactograph.nodes.scan.light_model_slope import light_model_slope
from tactograph.nodes.scan.read_light_model import check_frame, on_cells
from tactograph.nodes.scan.scan_pixel_size import scan_pixel_size
from tactograph.nodes.slope.pixel_mean_slope import pixel_mean_slope

MAX_STEP_SCALE = 1.25
"""Factor by which a known step may be deeper than a light model makes it, or it is another one."""
STEP_SEED = 2
"""Seed of the noise of its error, which that of other scans shares no draw with."""


@node
def known_step(
    model: LightModel,
    pixel: PixelSize,
    *,
    folder: Path | None = None,
    known_um: KnownDepth | None = None,
    scale: Scale | None = None,
    crop: Crop | None = None,
    part: Crop | None = None,
    along: Literal["x", "y"] = "x",
    edges: Annotated[int, Interval(ge=1, le=2)] = 2,
    level: str = "flat",
    cell: CellSide = 16,
    mm: float | None = None,
    solve: NodeCall = light_model_slope,
) -> KnownStep:
    """Reconstruct the scan of a known step as any other, and compare its depth.

    Balls leave open what radius, brightness of touched film and light model do to all slopes.  A
    step tells it.  Whatever the model gets wrong about a normal and a place it gets wrong for
    step and specimen alike, so each part of a height's error (`level_scan`) goes with one of the
    step's depth, and what both share is settled.

    Parameters
    ----------
    model
        As `read_light_model` gives it.
    pixel
        mm per px, of the model.
    folder
        A scan of the step; None: there is none, and `scale` is returned.
    known_um
        As for `measure_step`.
    scale
        As for `scale_height`, instead of a step.
    crop
        As for `read_capture`.
    part
        x0, y0, x1, y1 in pixels of the cropped scan, the part that shows one step.
    along, edges
        As for `measure_step`.
    level, cell
        As for `level_scan`.
    mm
        mm per px, instead of what the scan states.

    Raises
    ------
    InputError
        As `measure_step` and `check_frame`; if the depth is not given, or a scale as well, or the
        step found is another one.
    """
    if folder is None:
        return KnownStep(None if scale is None else np.array(scale, np.float32))
    if known_um is None or scale is not None:
        raise InputError(f"{folder}: a known step needs known_um=DEPTH,UNCERTAINTY and no scale=")
    (taken,) = read_capture(folder=folder, crop=crop, single=True)
    check_frame(taken.image, model, f"{folder}")
    pixel = scan_pixel_size(pixel, taken.pixel_size, mm=mm)
    cells = on_cells(model, cell)
    of_cells, of_single = (
        solve(coarsen(taken.image, factor=cell, take=take), cells) for take in ("mean", "corner")
    )
    judge_light_model(of_cells.brightness, of_cells.residual)
    side, slope = cell * pixel, of_cells.slope
    found = slope, of_cells.brightness, of_cells.residual
    levelling = ScanLevelling(*found, cells, side, level, cell)
    small = levelling.heights(slope).astype(np.float32)
    errors, _ = scan_errors(
        slope, of_cells.residual, of_single.residual, levelling, cell, STEP_SEED
    )
    raw = integrate_dct(pixel_mean_slope(solve(taken.image, model).slope), pixel)
    height = enlarge_height(small - integrate_dct(slope, side), taken.image, raw, factor=cell)
    shown = height if part is None else cropped(height, part, folder)
    x0, y0, x1, y1 = part or (0, 0, *raw.shape[::-1])
    there = slice(y0 // cell, -(-y1 // cell)), slice(x0 // cell, -(-x1 // cell))
    try:
        figures = measure_step(shown, pixel, 0 * shown, along=along, edges=edges, known_um=known_um)
        depth, *others = mean_depths(small[there], errors[:, *there], side, along, edges)
    except InputError as error:
        raise InputError(f"{folder}: {error} (here known_crop=, known_along=, …)") from None
    if not 1 / MAX_STEP_SCALE < figures["step_scale"] < MAX_STEP_SCALE:
        raise InputError(
            f"{folder}: its step is {abs(figures['step_depth_um']):.3g} um deep, not "
            f"{known_um[0]:g}: check known_um=, and that known_crop= shows this step alone"
        )
    scale = figures["step_scale"], figures["step_scale_error"]
    shares = np.array(others, np.float32) / np.float32(depth) - 1
    return KnownStep(np.array(scale, np.float32), shares)
