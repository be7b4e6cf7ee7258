"""The law of all checks (T6): how rare a figure is among valid touches of the same sensor.

A calibration keeps quantiles of the figures of valid touches that were drawn from it
(`draw_touches`).  The p-value of a figure is the share of valid touches whose figure is as large or
larger.  Within the largest fifth it falls exponentially, by the mean excess of that fifth: the
generalised Pareto law of shape 0, to which the tails of normal, chi and exponential figures tend
(J. Pickands, "Statistical inference using extreme order statistics", 1975).

The checks depend on one another.  So the smallest p-value of a touch is ranked among the smallest
p-values of the drawn touches, which is exact whatever the dependence (P. Westfall and S. Young,
"Resampling-based multiple testing", 1993).  In its tail the share is proportional to the p-value,
by the number of effectively independent checks.
"""

import math
from enum import IntEnum
from typing import Annotated, NamedTuple

import numpy as np

from tactograph.graph import Port
from tactograph.nodes import F4, F8, FALSE_ALARMS
from tactograph.nodes.stored import Stored
from tactograph.nodes.trust.checked_cells import MIN_LIGHT
from tactograph.nodes.trust.film_motion import FilmMotion, motion_size
from tactograph.nodes.trust.image_shifts import ImageShifts, creep_and_shift
from tactograph.nodes.trust.light_departure import MIN_ERROR
from tactograph.nodes.trust.line_changes import LineChanges
from tactograph.nodes.trust.touch_evidence import TouchEvidence

TAIL_SHARE = 0.2
"""Share of valid touches, the most extreme, that determine a tail."""
RANK_COUNT = 100
"""Number of quantiles: at 0.5 %, 1.5 %, ..."""
SHARE_ERROR = FALSE_ALARMS
"""Error of a share of cells: that of one in a hundred cells."""
QUANTILE_ERROR = math.sqrt(SHARE_ERROR)
"""Error of a quantile of a hundred cells, in units of their standard deviation."""
MIN_HEIGHT_MM = 0.15
"""Lower bound on the height that a depth below the film at rest is divided by."""
TAIL_START = RANK_COUNT - round(TAIL_SHARE * RANK_COUNT)


class Figure(NamedTuple):
    """A figure that grows with the contradiction in a touch: its check, and the likely cause."""

    check: str
    cause: str
    resolution: float = MIN_ERROR
    """Error of its measurement, a lower bound on the scale of its tail."""


# The light of two surfaces adds up to a normal that is too short, so the film looks dark under all
# LEDs.  Gamma, other light, and images that are alike have the same effect.
WRONG_BRIGHTNESS = Figure(
    "light",
    "the touched film is {bright} by {excess:.1%} than its slopes make it (check that the images "
    "show one touch, held still, neither blurred nor averaged with others, that gamma and contrast "
    "are off, and that other light is kept out{rims})",
)
IMAGES_APART = Figure(
    "rest",
    "the images of the LEDs lie {apart:.1%} of their width apart, as if film or camera moved "
    "between the flashes (hold still, wait until the film has settled, or flash faster)",
)
CHECK_FIGURES = {
    "curl": Figure(
        "curl",
        "no surface has these slopes (check the order of the images, that none is mirrored or "
        "turned, that frames are complete and all of one touch, and that nothing moved)",
        QUANTILE_ERROR,
    ),
    "dirty_cells": Figure(
        "light",
        "in places the film is darker under all LEDs than any slope explains (clean film and lens)",
        1.0,
    ),
    "lines": Figure(
        "light",
        "rows of the image differ from their neighbours, as on no surface (check that frames are "
        "complete and not interlaced, and that no row is dead)",
        QUANTILE_ERROR,
    ),
    "dark_share": Figure(
        "rest",
        "parts of the image are black (crop the images to the film, in the calibration too, and "
        "check that frames are complete)",
        SHARE_ERROR,
    ),
    "level": Figure(
        "rest",
        "{led} {sense} than in the calibration (check exposure, gain and LED, and that other light "
        "is kept out)",
    ),
    "moved": Figure("rest", "{moved}"),
    "creep": IMAGES_APART,
    "shift": IMAGES_APART,
    "brighter": WRONG_BRIGHTNESS,
    "darker": WRONG_BRIGHTNESS,
    "shape": Figure(
        "rest",
        "the light on the film at rest is distributed differently than in the calibration (check "
        "the order of the images; keep other light out)",
    ),
    "light_at_rest": Figure(
        "light",
        "the light of the film at rest varies from pixel to pixel (check the exposure, that local "
        "contrast (CLAHE) is off, and that format and gray levels are the calibration's)",
        QUANTILE_ERROR,
    ),
    "lit_shadows": Figure(
        "light",
        "shadows are not dark (check the focus; keep other light out, or calibrate under it with "
        "a dark image)",
    ),
    "light": Figure(
        "light",
        "no surface explains the light of the touch under this calibration (check the order of "
        "the images, that all are of this touch and this sensor, and that the camera's gamma, "
        "contrast and white balance are off{rims})",
        QUANTILE_ERROR,
    ),
    "depth": Figure(
        "rest",
        "most of the touch lies below the film at rest (check the order of the images, and that "
        "they are neither mirrored nor turned)",
        SHARE_ERROR,
    ),
    "touched_share": Figure(
        "rest",
        "hardly any film is at rest, so zero and tilt of the height are unknown (if an object "
        "fills the frame run reconstruct_filled; else check sensor and light)",
        SHARE_ERROR,
    ),
    "matt_residual": Figure("cause", ""),
}
"""All figures of a touch, by name; figures that have several causes come late.  The last belongs to
no check: it separates mistakes that explain a doubted touch from others (`likely_cause`)."""
REST_FIGURES = np.isin([*CHECK_FIGURES], ["level", "moved", "shape", "light_at_rest"])
"""Which figures are of untouched film, which no wall of an object changes."""
SHADOW_FIGURE = [*CHECK_FIGURES].index("lit_shadows")
"""The place of a figure that few valid touches of soft film show; 0: it shows too few shadows."""
FIGURE_ERRORS = np.array([figure.resolution for figure in CHECK_FIGURES.values()])
CheckRanks = Annotated[
    F4,
    Port("3 18 100", "1", low=0, high=3),
    Stored(-1, 1e6, plain=-1.0),
    "quantiles of the figures of valid touches, which a touch is compared with; -1: not known",
]
"""For each `Ranked` ascending quantiles of the figures, and in the last row of the smallest
p-values."""


class Ranked(IntEnum):
    """The touches to compare with: soft ones, ones with walls, or those of graphs that do not check
    the light."""

    SOFT = 0
    RIGID = 1
    PLAIN = 2


def figures_of(
    evidence: TouchEvidence,
    lines: LineChanges | None = None,
    motion: FilmMotion | None = None,
    shifts: ImageShifts | None = None,
    residual: float = 0.0,
) -> F8:
    """Return the figures of a touch (T1 to T5, T7), in the order of `CHECK_FIGURES`.

    `lines` (one-shot sensors), `motion`, `shifts` and `residual` are the results of `line_changes`,
    `film_motion`, `image_shifts` and `matt_residual`, as far as they were computed.
    """
    found = evidence.read()
    change = evidence.level.astype(np.float64) - 1
    level = math.sqrt(float(np.square(change).mean()))
    rows = 0.0 if lines is None else _worst_line(lines)
    moved = 0.0 if motion is None else max(motion_size(motion), abs(motion.item(4)))
    apart = (0.0, 0.0) if shifts is None else creep_and_shift(shifts)
    sure = found.curl, found.dirty, rows, found.dark, level, moved, *apart
    bright = found.brighter, -found.brighter
    deep = -found.lowest / max(found.highest, MIN_HEIGHT_MM)
    vague = found.shape, found.at_rest, found.dim, found.of_touch, deep, 1 - found.calm
    return np.array([*sure, *bright, *vague, residual])


def _worst_line(lines: LineChanges) -> float:
    """The departure of the worst row from its neighbours, over that of the worst column (T5)."""
    across, along, columns = lines
    worst = float((across / np.maximum(along, MIN_LIGHT)).max())
    return worst / max(float(columns.max() / max(np.median(columns), MIN_LIGHT)), 1.0)


def ranked(drawn: F8, own: F8 | None = None, others: F8 | None = None) -> F8:
    """Return the quantiles of valid touches' figures that a calibration keeps.

    Drawn touches have only the model's errors, and a real film has others.  So the calibration's
    presses count as well, with the weight of a tail: their excess over the drawn touches sets its
    scale.  Nothing changes where presses look like drawn touches.  A tail that starts farther out
    because of them falls no faster.

    Parameters
    ----------
    drawn : N x 17, the figures of touches drawn from the calibration
    own : P x 17, the figures of its presses; P may be 0
    others
        M x 17, those of valid touches of another kind.  Light in shadow is ranked among all that
        have shadows, since most soft touches show none.
    """
    levels = (np.arange(RANK_COUNT) + 0.5) / RANK_COUNT
    quantiles, both = np.quantile(drawn, levels, axis=0), drawn
    shadows = np.concatenate([drawn, drawn[:0] if others is None else others])[:, SHADOW_FIGURE]
    if shadows.any():
        quantiles[:, SHADOW_FIGURE] = np.maximum(np.quantile(shadows[shadows != 0], levels), 0)
    if own is not None and len(own):
        weight = round(TAIL_SHARE / (1 - TAIL_SHARE) * len(drawn))
        both = np.concatenate([drawn, own[np.arange(max(weight, len(own))) % len(own)]])
        tail = quantiles[TAIL_START:] - quantiles[TAIL_START - 1]
        quantiles = np.maximum(quantiles, np.quantile(both, levels, axis=0))
        farther = quantiles[TAIL_START - 1] + tail
        quantiles[TAIL_START:] = np.maximum(quantiles[TAIL_START:], farther)
    least = [p_values(each, quantiles.T)[:-1].min() for each in both]
    return np.vstack([quantiles.T, np.quantile(least, levels)])


def p_values(figures: F8, quantiles: F8) -> F8:
    """Return for each figure the share of valid touches whose figure is as large or larger."""
    start = quantiles[:, TAIL_START - 1]
    scale = np.maximum((quantiles[:, TAIL_START:] - start[:, None]).mean(axis=1), FIGURE_ERRORS)
    beyond = TAIL_SHARE * np.exp(-np.maximum(figures - start, 0) / scale)
    above = (1 + (quantiles >= figures[:, None]).sum(axis=1)) / (1 + RANK_COUNT)
    return np.where(figures > start, beyond, np.maximum(above, TAIL_SHARE))


def residual_share(ranks: F8, residual: float) -> float:
    """Return the p-value of a touch's `matt_residual`."""
    return float(p_values(np.full(len(CHECK_FIGURES), residual), ranks[:-1])[-1])


def of_all_checks(least: float, ranks: F8) -> float:
    """Return the share of valid touches whose smallest p-value is as small or smaller."""
    drawn = ranks[-1]
    tail = drawn[RANK_COUNT - TAIL_START - 1]
    if least < tail:
        return float(least * min(TAIL_SHARE / tail, len(CHECK_FIGURES) - 1))
    return float((drawn <= least).mean())
