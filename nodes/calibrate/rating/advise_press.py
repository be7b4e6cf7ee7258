"""Report what the presses cover, and advise what to press next."""

import numpy as np

from tactograph.graph import node
from tactograph.nodes import F4, F8, U1, Light
from tactograph.nodes.calibrate.rating.verdict import Advice, Judged
from tactograph.nodes.calibrate.tables.build_lut import in_tables
from tactograph.nodes.optics.sheet import SheetLabels, SheetMask, SheetSlope, cut

FILM_REGIONS = (
    ("at the upper left", "at the top", "at the upper right"),
    ("at the left", "in the middle", "at the right"),
    ("at the lower left", "at the bottom", "at the lower right"),
)
"""Names of the nine parts of the film."""
BALL_SIDES = (
    "right", "lower right", "lower side", "lower left",
    "left", "upper left", "upper side", "upper right",
)  # fmt: skip
"""Sides of a ball, clockwise from x.  The right side is where the film falls to the right."""
MIN_TOUCHED_SHARE = 0.15
"""Share of each part of the film that contacts must cover."""
FULL_SLOPE = 1.0
"""Slope up to which every direction should be covered."""


@node
def advise_press(
    flat: Light,
    slope: SheetSlope,
    mask: SheetMask,
    lit: SheetLabels,
    doubts: list[str] | None = None,
) -> Advice:
    """Measure how much of the film and of the slopes the presses cover, and name the gaps.

    Parameters
    ----------
    flat : K x H x W, for its size
    slope, mask, lit : the used presses on a sheet: 2 x S x W, S x W, S x W
    doubts : doubts about the calibration, which matter more than further presses

    Returns
    -------
    ``film_covered_percent``, the share of the film's nine parts; ``slopes_covered_percent``, the
    share of the slopes up to 1 in eight directions; and a sentence such as "press at the lower
    left: no contact reaches there".
    """
    count, rows, _ = flat.shape
    touched = _touched(mask, rows)
    steep = _steepest(slope[:, in_tables(mask, lit, count)])
    presses = sum(bool(part.any()) for part in cut(mask, rows))
    quality = {
        "film_covered_percent": float(100 * (touched >= MIN_TOUCHED_SHARE).mean()),
        "slopes_covered_percent": float(100 * (np.minimum(steep, FULL_SLOPE) / FULL_SLOPE).mean()),
    }
    judged = Judged(quality, doubts or [])
    return Advice(quality, judged.advice(_advice(presses, touched, steep)))


def _touched(mask: U1, rows: int) -> F8:
    """The share of each of the film's nine parts that contacts cover."""
    film = np.maximum.reduce([part > 0 for part in cut(mask, rows)])
    bands = [np.array_split(band, 3, axis=1) for band in np.array_split(film, 3, axis=0)]
    return np.array([[part.mean() if part.size else 1 for part in band] for band in bands])


def _steepest(slope: F4) -> F8:
    """The slope up to which each direction is covered; a slope falls away from its ball."""
    towards = np.arctan2(-slope[1], -slope[0])
    sector = np.rint(towards / (2 * np.pi) * len(BALL_SIDES)).astype(int) % len(BALL_SIDES)
    steep = np.zeros(len(BALL_SIDES))
    np.maximum.at(steep, sector, np.hypot(slope[0], slope[1]))
    return steep


def _advice(presses: int, touched: F8, steep: F8) -> str:
    row, column = np.unravel_index(int(touched.argmin()), touched.shape)
    flattest = int(steep.argmin())
    empty, gentle = touched[row, column] < MIN_TOUCHED_SHARE, steep[flattest] < FULL_SLOPE
    if not empty and not gentle:
        if presses == 1:
            return "press once more: a single press cannot be checked by another"
        return "the presses cover the film and the slopes; nothing more is needed"
    where = f" {FILM_REGIONS[row][column]}" if empty else ""
    how = ("," if where else "") + " deeper, or with a smaller ball" if gentle else ""
    share = touched[row, column]
    reached = f"contacts cover {share:.0%} of it" if share else "no contact reaches there"
    why = [reached] if empty else []
    if gentle:
        side = BALL_SIDES[flattest]
        why.append(f"slopes on the {side} of the pressed objects end at {steep[flattest]:.2f}")
    if presses == 1:
        why.append("a single press cannot be checked by another")
    return f"press{where}{how}: {', and '.join(why)}"
