"""Rate a calibration by many presses, on held-out presses."""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray

from tactograph.rings.oneshot.nodes.presses import Circles, PressImages
from tactograph.rings.oneshot.nodes.presses.fit_reflectance_map import Bench, degree_for
from tactograph.sdk import F4, FoundBalls, Judged, Light, PixelSize, Port, node, warn

COVERAGE_CELLS = (4, 6)
"""Rows and columns of cells into which the film is divided to measure coverage."""
MIN_COVERED_SHARE = 0.85
"""Share of the cells that contacts should reach."""
MIN_RIM_SLOPE = 0.5
PART_COUNT = 5
"""Parts into which the presses are split, each held out in turn."""


class PressRating(NamedTuple):
    """Figures for programs; for people what to press next, what is doubtful, and the verdict."""

    quality: dict[str, float]
    advice: str
    doubts: list[str]
    verdict: str
    heldout_deg: Annotated[F4, Port("B", "deg")]
    """Mean angle between normals in each contact; 0 where it is left out or not seen."""


@node
def rate_presses(
    image: PressImages,
    flat: Light,
    balls: FoundBalls,
    circle: Circles,
    selection: Annotated[NDArray[np.uint8], Port("B", "flag", high=1)],
    rim: Annotated[float, Port(unit="mm")],
    residual: Annotated[F4, Port("K", "1")],
    pixel: PixelSize,
    of_radius: Judged | None = None,
    of_pixels: list[str] | None = None,
    of_punches: Judged | None = None,
    *,
    radius_mm: Annotated[float, Gt(0)],
) -> PressRating:
    """Return the errors on held-out presses, the coverage, and what to press next.

    For each fold, a map fitted to the other folds' presses reconstructs the fold's presses like
    any capture.  A held-out circle keeps the contact radius from `find_presses`; its centre is
    found with the map of the others.

    Parameters
    ----------
    image, flat : P x K x H x W presses and the K x H x W film at rest
    balls, circle : as `find_presses` returns them, and their circles after refining, B x 3 in px
    selection, rim, residual : as `fit_reflectance_map` returns them
    pixel : mm per px
    of_radius, of_pixels : what `judge_radius` and the doubts that `judge_oblong` returns
    of_punches : what `judge_punches` returns
    radius_mm : the ball's radius

    Returns
    -------
    ``heldout_normal_deg``, mean angle between normals in the contact; ``heldout_height_um``, root
    mean square error of the height there without its mean, because the height of the ball's rim is
    unknown; ``heldout_height_percent`` of the cap; ``presses`` kept; ``residual_percent``;
    ``film_covered_percent``; ``steepest_slope``, the median slope at the contacts' rims;
    ``rim_um``; one sentence of advice; the doubts, each of them also a warning;
    the verdict; and the error of each contact.
    """
    chosen = np.flatnonzero(selection)
    degree = degree_for(chosen.size * (PART_COUNT - 1) // PART_COUNT)
    errors = np.zeros((len(selection), 3))
    bench = Bench.of(image, flat, radius_mm, pixel, degree, balls)
    for part in range(PART_COUNT):
        held_out, training = chosen[part::PART_COUNT], selection > 0
        training[held_out] = False
        reflectance, _ = bench.fit_presses(circle.astype(np.float64), training, rim, 1)
        for press in held_out.tolist():
            at = balls.circle[press].astype(np.float64)
            at = bench.refine_center(reflectance, at, press, rim, steps=6)
            errors[press] = bench.ball(at).errors(*bench.reconstruct(reflectance, press))
    judged = chosen[np.isfinite(errors[chosen, 0])]
    degrees, microns, percent = errors[judged].mean(axis=0) if judged.size else [np.nan] * 3
    pressed = presses_per_cell(circle[chosen], bench.shape)
    steepest = rim_slope(circle[chosen], bench.radius)
    quality = {
        "heldout_normal_deg": float(degrees),
        "heldout_height_um": float(microns),
        "heldout_height_percent": float(percent),
        "presses": float(chosen.size),
        "residual_percent": float(100 * residual.max()),
        "film_covered_percent": float(100 * (pressed > 0).mean()),
        "steepest_slope": steepest,
        "rim_um": 1e3 * rim,
    }
    of_radius, of_punches = of_radius or Judged({}, []), of_punches or Judged({}, [])
    heldout = Judged.of_heldout("heldout_normal_deg", float(degrees))
    doubts = (of_pixels or []) + heldout.doubts + of_radius.doubts + of_punches.doubts
    for doubt in doubts:
        warn(doubt)
    judged = heldout._replace(doubts=doubts, unconfirmed=of_radius.unconfirmed)
    advice = judged.advice(advise(pressed, bench.shape, steepest))
    verdict = judged.verdict("heldout_normal_deg")
    quality |= of_radius.quality | of_punches.quality
    angles = np.nan_to_num(errors[:, 0]).astype(np.float32)
    return PressRating(quality, advice, doubts, verdict, angles)


def presses_per_cell(circles: F4, shape: tuple[int, int]) -> F4:
    """Number of contacts that reach the middle of each cell of the film."""
    (rows, columns), (height, width) = COVERAGE_CELLS, shape
    row, column = np.indices(COVERAGE_CELLS)
    x, y = (column + 0.5) * width / columns - 0.5, (row + 0.5) * height / rows - 0.5
    reach = 0.25 * min(width / columns, height / rows)
    far = np.hypot(x[..., None] - circles[:, 0], y[..., None] - circles[:, 1])
    return np.asarray((far < circles[:, 2] + reach).sum(axis=-1), np.float32)


def rim_slope(circles: F4, radius: float) -> float:
    """The median slope at the contacts' rims; the ball's `radius` is in px."""
    rim = circles[:, 2]
    return float(np.median(rim / np.sqrt(np.maximum(radius**2 - rim**2, 1))))


def advise(pressed: F4, shape: tuple[int, int], steepest: float) -> str:
    """Say what to press next: the emptiest part of the film, or deeper, or nothing."""
    (rows, columns), (height, width) = COVERAGE_CELLS, shape
    if (pressed > 0).mean() < MIN_COVERED_SHARE:
        row, column = np.unravel_index(int(pressed.argmin()), pressed.shape)
        x, y = (column + 0.5) * width / columns, (row + 0.5) * height / rows
        return f"press around {x:.0f},{y:.0f} px: no contact reaches there"
    if steepest < MIN_RIM_SLOPE:
        return f"press deeper: half of the contacts end at a slope of {steepest:.2f}"
    return "the presses cover the film; nothing more is needed"
