"""The equations for the height: steps between neighbours, rises across shadows, film at rest."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, Mask, ShadowRises, Slope, SlopeVariance
from tactograph.nodes.height._springs import Springs, Ties

MARGIN = 8
HOLD = np.float32(1e5)
"""Stiffness of the film at rest; that of the surest step is 1."""
KNOWN = np.float32(1e6)
"""Variance from which on a slope is unknown."""
SMOOTH = np.float32(1)
"""Variance up to which a slope counts in a cubic."""
LONELY = np.float32(4)
"""Variance that a step has in addition if only one slope is known."""
WALL = np.float32(1e3)
HALF, QUARTER = np.float32(0.5), np.float32(0.25)


Pixel = TypeVar("Pixel", bound=np.generic)


class Window(NamedTuple):
    """The part of the frame that is not at rest, and a margin."""

    rows: slice
    columns: slice

    def of(self, plane: NDArray[Pixel]) -> NDArray[Pixel]:
        return np.ascontiguousarray(plane[..., self.rows, self.columns])


class HeightSystem(NamedTuple):
    """Steps of height to the right and down with variances, rises, and what is at rest."""

    right: F4
    down: F4
    right_variance: F4
    down_variance: F4
    at_rest: F4
    rises: Ties
    rise: F4
    rise_variance: np.float32
    unit: np.float32

    def cut(self, height: F4) -> F4:
        """A height inside the window, put to zero on the film at rest."""
        return np.where(self.at_rest > 0, np.float32(0), height)

    def residuals(self, height: F4) -> tuple[F4, F4, F4]:
        """By how much the height departs from the targets, in mm."""
        flat = height.ravel()
        return (
            height[:, 1:] - height[:, :-1] - self.right,
            height[1:] - height[:-1] - self.down,
            flat[self.rises.top] - flat[self.rises.foot] - self.rise,
        )

    def cost(self, height: F4, scale: float) -> float:
        """What is minimised: the sum of log(1 + r^2 / (scale^2 variance))."""
        square = np.float32(scale * scale)

        def part(residual: F4, variance: F4 | np.float32) -> float:
            return float(np.log1p(residual * residual / square / variance).sum(dtype=float))

        right, down, rise = self.residuals(height)
        steps = part(right, self.right_variance) + part(down, self.down_variance)
        return steps + part(rise, self.rise_variance)

    def springs(self, height: F4, scale: float) -> Springs:
        """The network, each spring weaker the farther the height departs from it.

        Cauchy's weights: 1 / (variance (1 + r^2 / (scale^2 variance))), in units of the
        stiffest step's.
        """
        square = np.float32(scale * scale)

        def stiffness(residual: F4, variance: F4 | np.float32) -> F4:
            return np.asarray(self.unit / (variance + residual * residual / square), np.float32)

        right, down, rise = self.residuals(height)
        return Springs(
            stiffness(right, self.right_variance),
            stiffness(down, self.down_variance),
            self.at_rest * HOLD,
            self.rises._replace(stiffness=stiffness(rise, self.rise_variance)),
        )


def contact_window(rest: Mask, mask: Mask | None) -> Window:
    """The smallest window around all that counts and is not at rest; a few pixels if all is."""
    touched = rest == 0 if mask is None else (rest == 0) & (mask != 0)
    return window_around(touched.any(axis=1), touched.any(axis=0))


def window_around(rows: NDArray[np.bool_], columns: NDArray[np.bool_]) -> Window:
    """The window around the rows and columns that are touched, with its margin."""
    return Window(
        _span(np.flatnonzero(rows), len(rows)), _span(np.flatnonzero(columns), len(columns))
    )


def _span(found: NDArray[np.intp], size: int) -> slice:
    first, last = (int(found[0]), int(found[-1])) if found.size else (0, 0)
    return slice(max(first - MARGIN, 0), min(last + 1 + MARGIN, size))


def height_system(
    window: Window,
    slope: Slope,
    variance: SlopeVariance,
    rest: Mask,
    rises: ShadowRises,
    pixel: float,
    mask: Mask | None,
    *,
    bend: float,
    floor: float,
    rise_px: float,
) -> HeightSystem:
    """Gather the equations inside a window of the frame.

    Parameters
    ----------
    mask
        The pixels that count; no equation contains another.
    bend
        Standard deviation of a step, in px, per difference of the slopes at its ends.
    floor
        Standard deviation, in px, of every step.
    rise_px
        Standard deviation of a rise, in px.
    """
    slopes, variances = window.of(slope), window.of(variance)
    at_rest = window.of(rest.astype(np.float32))
    if mask is not None:
        counts = window.of(mask) != 0
        variances = np.where(counts, variances, np.float32(np.inf))
        at_rest = np.where(counts, at_rest, np.float32(0))
    right, right_variance = _steps(slopes[0], variances[0], bend, floor)
    down, down_variance = _steps(slopes[1].T, variances[1].T, bend, floor)
    size = np.float32(pixel)
    ties, rise = rises_inside(window, rises, rest.shape[1], mask)
    return HeightSystem(
        right * size,
        down.T * size,
        right_variance * size * size,
        down_variance.T * size * size,
        at_rest,
        ties,
        rise,
        rise_variance(rise_px, pixel),
        stiffest(floor, pixel),
    )


def stiffest(floor: float, pixel: float) -> np.float32:
    """The variance of the surest step, in mm^2."""
    return np.float32((floor * pixel) ** 2)


def rise_variance(rise_px: float, pixel: float) -> np.float32:
    """The variance of a shadow's rise, in mm^2."""
    return np.float32((rise_px * pixel) ** 2)


def _steps(slope: F4, variance: F4, bend: float, floor: float) -> tuple[F4, F4]:
    """Steps along the rows in px, from the slopes at both ends, and their variances.

    On smooth film a cubic through four slopes weights them with (-1, 9, 9, -1) / 16; elsewhere
    two slopes are used.  If only one slope is known, it is used with little weight.  A slope of
    infinite variance makes that of the step infinite.
    """
    before, after = slope[:, :-1], slope[:, 1:]
    of_before, of_after = variance[:, :-1], variance[:, 1:]
    step = HALF * (before + after)
    step[:, 1:-1] += _cubic_part(slope, variance)
    turn = np.float32(bend) * (after - before)
    both = QUARTER * (of_before + of_after) + turn * turn
    surer = np.where(of_before < of_after, before, after)
    # A wall ends within the pixel that shows it.
    little = np.minimum(np.minimum(of_before, of_after), WALL) + LONELY + surer * surer
    alone = np.where(np.isinf(both), both, little)
    known = np.maximum(of_before, of_after) < KNOWN
    return np.where(known, step, surer), np.where(known, both, alone) + np.float32(floor * floor)


def _cubic_part(slope: F4, variance: F4) -> F4:
    """What four slopes add to the mean of the inner two; at most a quarter of their difference."""
    before, after = slope[:, 1:-2], slope[:, 2:-1]
    curve = (before + after - (slope[:, :-3] + slope[:, 3:])) / np.float32(16)
    limit = QUARTER * np.abs(after - before)
    smooth = (variance[:, :-3] < SMOOTH) & (variance[:, 3:] < SMOOTH)
    return np.where(smooth, np.clip(curve, -limit, limit), np.float32(0))


def rises_inside(
    window: Window, rises: ShadowRises, columns: int, mask: Mask | None
) -> tuple[Ties, F4]:
    """The rises of which both ends lie in the window and count, numbered by its pixels.

    A tie's `stiffness` is 1 here.
    """
    ends = []
    kept = np.ones(rises.top.size, bool)
    width = window.columns.stop - window.columns.start
    for index in (rises.top.astype(np.int64), rises.foot.astype(np.int64)):
        row, column = index // columns, index % columns
        kept &= (row >= window.rows.start) & (row < window.rows.stop)
        kept &= (column >= window.columns.start) & (column < window.columns.stop)
        if mask is not None:
            kept &= mask.ravel()[index] != 0
        ends.append((row - window.rows.start) * width + column - window.columns.start)
    ones = np.ones(int(kept.sum()), np.float32)
    return Ties(ends[0][kept], ends[1][kept], ones), rises.rise[kept]
