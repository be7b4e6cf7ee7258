"""What levels a scan, as a height to be added, and the error that is left.

Long because both go through one factor of the same equations.
"""

from typing import Annotated, NamedTuple

import cv2
import numpy as np
from annotated_types import Ge, Interval

from tactograph.rings.metrology.nodes.filled.scale_height import Scale
from tactograph.rings.metrology.nodes.scan._scan_error import scan_errors
from tactograph.rings.metrology.nodes.scan._scan_levelling import ScanLevelling
from tactograph.rings.metrology.nodes.scan.judge_untouched import MAX_UNTOUCHED_SLOPE
from tactograph.rings.metrology.nodes.scan.light_model import LightModel
from tactograph.rings.metrology.nodes.scan.light_model_slope import ModelSlope
from tactograph.rings.metrology.nodes.scan.scale_step import ScaleStep
from tactograph.rings.metrology.nodes.surface.measure_step import ErrorParts
from tactograph.sdk import F4, Height, HeightError, PixelSize, Port, SizeLimit, node, warn
from tactograph.sdk.nodes import integrate_dct

MAX_SQUARED_SLOPE = 3.0
"""Square of the steepest slope that a light model measures."""
NOMINAL_GROWTH = 0.01
"""Share of a height by which it errs, over the square of its slope, in the last part."""
GROWTH_OF_SCALE = 0.7
"""The same of a scan by a model that a known step has found wrong, over what it is wrong by."""

EDGE_LACK = (1 / 6) / (5 / 144) - 1
"""What an edge's slopes lack, over what `pixel_mean_slope` adds.  An edge anywhere in its pixel
leaves a variance of 1/6 of the squared change of the normal, the mean of f (1 - f); half the
change over two pixels, squared, over 12, at the pixel and both neighbours, is 5/144 of it."""

RawHeight = Annotated[F4, Port("Y X", "mm")]
"""The integral of a scan's slopes, on pixels."""
PixelSlope = Annotated[F4, Port("2 Y X", "mm/mm")]


class ScanLevel(NamedTuple):
    """What is added to a height to level it, the height's error, and how much is a bow."""

    bend: Height
    error: HeightError
    metrics: dict[str, float]
    parts: ErrorParts
    settled: ErrorParts | None = None
    """The parts where a step of known depth settled them."""


@node(sizes={"K": SizeLimit(4, 8, "three leave nothing to tell the error by")})
def level_scan(
    fit: ModelSlope,
    single: ModelSlope,
    model: LightModel,
    pixel: PixelSize,
    raw: RawHeight,
    turned: PixelSlope,
    mean: PixelSlope,
    step: ScaleStep | None = None,
    *,
    scale: Scale | None = None,
    level: str = "flat",
    cell: Annotated[int, Interval(ge=1, le=64)] = 16,
    seed: Annotated[int, Ge(0)] = 1,
) -> ScanLevel:
    """Return what to add to `raw`, on cells, and how far the height may be off.

    Cells are integrated a second time, with weights: a slope counts by what the light that its
    cell leaves unexplained may do to it.  So steep film, which is measured worst, bends no level
    film.  From the slopes a drift is taken first, as far as film is known to be flat: a light model
    tells level film only up to slopes that change linearly over the frame.

    An edge within a pixel mixes the light of both its sides: the slope of the mean normal is not
    the mean slope.  `pixel_mean_slope` takes the change for an even one and adds a part of what is
    lacking; the rest is integrated alike (`EDGE_LACK`).

    Parameters
    ----------
    fit, single
        What `light_model_slope` finds from the mean light of cells of H x W, and from one pixel of
        each: the mean light over an edge tells nothing of how steep its wall is.
    model : the light model on cells
    pixel : side of a cell in mm
    raw : the integral of the slopes of all pixels
    turned, mean
        2 x Y x X, the slopes of pixels' mean light, and what `pixel_mean_slope` makes of them.
    step
        What a known step settles: heights will be scaled, so each part of the error is less what
        the step's depth has of it, and the factor's uncertainty is one more.  A model that the step
        found wrong is wrong by another factor on walls of another slope: that is one part more.
    scale : factor and its uncertainty, as for `scale_height`, instead of a known step
    level
        ``flat``: most of the surface is a plane, which tells drift and plane.  ``plane``: most of
        it is level, but may bend; nothing but a plane is taken off.  ``rest``: the frame's border
        is at rest.  Else an image of the scan's size, not 0 where the surface is flat and level.
        Film that is known over less than half of the frame's width or height tells a plane only.
    cell : side of a cell in pixels
    seed : seed of the error's random draws

    Returns
    -------
    H x W in mm; the standard deviation of the height, H x W in mm; ``level_bow_um``, from the
    lowest to the highest place of the bow that the drift would be, and the known step's figures;
    the parts of the error, E x H x W.

    Raises
    ------
    InputError
        As `level_plane`.
    """
    levelling, slope = ScanLevelling(fit, model, pixel, level, cell), fit.slope
    height = levelling.heights(slope)
    by_cells = integrate_dct(slope, pixel)
    apart = by_cells - _in_cells(raw, cell)
    added = np.stack([_in_cells(each, cell) for each in mean - turned])
    lacking = EDGE_LACK * levelling.levelled(integrate_dct(added, pixel))
    # What is level is at zero on pixels, too, where edges hold another share of the height.
    bend = height - by_cells + (apart - levelling.levelled(apart))
    drifting = np.tensordot(levelling.drift[:, 1:], levelling.terms[1:], 1)
    bow = 1e3 * float(np.ptp(integrate_dct(np.float32(drifting), pixel)))
    lean = float(np.abs(drifting).max())
    if lean > MAX_UNTOUCHED_SLOPE:
        warn(
            f"the slopes of flat film drift by {lean:.2g} to the frame's border, which would "
            f"bow it by {bow:.0f} um: taken for the light model's, not the surface's "
            "(`level`=plane leaves it)"
        )
    errors, inside = scan_errors(fit, single.residual, levelling, cell, seed)
    squares = (np.sum(each * each, axis=0) for each in (slope, single.slope))
    square = cv2.dilate(np.maximum(*squares), np.ones((3, 3)))
    growth = levelling.heights(slope * np.minimum(square, MAX_SQUARED_SLOPE))
    errors = np.concatenate([errors, [lacking]]).astype(np.float32)
    parts = np.concatenate([errors, [NOMINAL_GROWTH * growth]]).astype(np.float32)
    factor, settled = 1.0, None
    figures: dict[str, float] = {"level_bow_um": bow}
    stated_scale = scale if step is None else step.scale
    if stated_scale is not None:
        factor, uncertain = stated_scale
        if step is not None:
            errors = parts - np.float32(step.errors[:, None, None] * height)
            errors[-1] *= abs(factor - 1) * GROWTH_OF_SCALE / NOMINAL_GROWTH
        errors = np.concatenate([factor * errors, [uncertain * height]]).astype(np.float32)
        settled = parts = errors
    error = np.sqrt(np.square(errors).sum(axis=0) + factor**2 * inside).astype(np.float32)
    figures |= step.metrics if step else {}
    return ScanLevel(np.asarray(bend, np.float32), error, figures, parts, settled)


def _in_cells(height: F4, cell: int) -> F4:
    """Means of cells; those at the border go on beyond it."""
    down, right = (-size % cell for size in height.shape)
    whole = np.pad(height, ((0, down), (0, right)), mode="edge")
    size = whole.shape[1] // cell, whole.shape[0] // cell
    return np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA))
