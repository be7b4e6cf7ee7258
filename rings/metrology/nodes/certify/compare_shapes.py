"""Points of known shapes: the height that was found against the one that is true."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, maximum_filter

from tactograph.rings.metrology.nodes.certify.measure_touches import Heights
from tactograph.rings.metrology.nodes.filled.level_plane import plane_terms, weighted_plane
from tactograph.sdk import F4, F8, InputError, PixelSize, Port, node, warn

TOUCHED_SHARE = 0.85
"""Share of the radius of contact that counts: further out pixels mix film and ball."""
SMOOTH_SHARE = 0.1
"""Deviation of the Gaussian by which a height is smoothed to find tops, over the ball's radius."""
TOP_SHARE = 0.5
"""Least height of a ball's top, over that of the highest."""
FIT_STEPS, MIN_POINTS = 8, 30
Points = Annotated[F8, Port("M", "mm", low=-1, high=5)]
Numbers = Annotated[NDArray[np.int32], Port("M", "number")]


class Compared(NamedTuple):
    """M points: true and found height, its stated deviation (NaN: none), shape and touch of each.

    There are none where no shape is known.
    """

    true: Points = np.empty(0)
    measured: Points = np.empty(0)
    stated: Annotated[F8, Port("M", "mm", nan=True)] = np.empty(0)
    shape: Numbers = np.empty(0, np.int32)
    touch: Numbers = np.empty(0, np.int32)


Pairs = tuple[F8, F8, F8]
"""True and found heights of a shape's points, and their stated deviation."""


@node
def compare_shapes(
    height: Heights | None = None,
    error: Heights | None = None,
    truth: Heights | None = None,
    pixel: PixelSize | None = None,
    *,
    ball_radius_mm: Annotated[float, Gt(0)] | None = None,
    zero: Literal["rest", "free", "plane"] = "rest",
) -> Compared:
    """Compare the heights of touches with the truth beside them, or with balls of known radius.

    How deep a ball sits is not known, so both heights are those above the ball's mean.  Its
    place is where a sphere fits best: a tilt of all of a ball cannot be separated from its place.
    Film surely touches a ball within the radius sqrt(R d) at depth d, that of a half-space (Hertz
    1881); a thin gel touches it further out.

    Parameters
    ----------
    height, error, truth : N x H x W in mm, as `measure_touches` gives them
    pixel : mm per px
    ball_radius_mm : radius of every ball in touches without a truth
    zero
        What is left free of a height that has a truth.  "rest": nothing, zero is the film at
        rest; "free": its zero; "plane": its zero and tilt, of an object that fills the frame.

    Raises
    ------
    InputError
        If no touch shows a known shape, or what is touched is not known.
    """
    if height is None or pixel is None:
        return Compared()
    parts: list[tuple[NDArray[Any], ...]] = []
    for number, measured in enumerate(height):
        stated = np.full(measured.shape, np.nan) if error is None else error[number]
        truth_of_touch = None if truth is None else truth[number]
        if truth_of_touch is not None and np.isfinite(truth_of_touch).any():
            shapes = [_by_truth(measured, stated, truth_of_touch, zero)]
        elif ball_radius_mm is not None:
            shapes = list(_by_balls(measured, stated, ball_radius_mm / float(pixel), float(pixel)))
        else:
            raise InputError(
                "the captures hold no truth_height_mm.npy, so their shape is not known; of balls "
                "give `ball_radius_mm`"
            )
        shapes = [pairs for pairs in shapes if len(pairs[0]) > MIN_POINTS and np.ptp(pairs[0]) > 0]
        if not shapes:
            warn(f"touch {number + 1} shows no whole known shape; it is left out")
        for pairs in shapes:
            of = (np.full(len(pairs[0]), n, np.int32) for n in (len(parts), number))
            parts.append((*pairs, *of))
    if not parts:
        raise InputError(
            "no touch shows a whole known shape; are they touches, and is `ball_radius_mm` right?"
        )
    return Compared(*map(np.concatenate, zip(*parts, strict=True)))


def _by_truth(measured: F4, stated: F4, truth: F4, zero: str) -> Pairs:
    """Where something touches, or all of an object that fills the frame."""
    is_known = np.isfinite(truth) & np.isfinite(measured)
    true, height = truth.astype(np.float64), measured.astype(np.float64)
    if zero == "plane":
        terms = np.stack(np.broadcast_arrays(*plane_terms(*measured.shape)), axis=-1)[is_known]
        height[is_known] -= terms @ weighted_plane(
            terms, (height - true)[is_known], np.ones(len(terms))
        )
    if zero == "rest":
        is_known &= truth > 0
        return true[is_known], height[is_known], stated[is_known].astype(np.float64)
    return _above_mean(true[is_known], height[is_known], stated[is_known])


def _above_mean(true: F8, measured: F8, stated: F4) -> Pairs:
    return true - true.mean(), measured - measured.mean(), stated.astype(np.float64)


def _by_balls(measured: F4, stated: F4, radius: float, pixel: float) -> Iterator[Pairs]:
    """The caps of all balls that lie whole in the frame; `radius` in px."""
    height = measured.astype(np.float64) / pixel
    smooth = gaussian_filter(height, SMOOTH_SHARE * radius)
    tops = smooth == maximum_filter(smooth, size=2 * int(radius / 2) + 1)
    tops &= smooth > TOP_SHARE * smooth.max()
    for row, column in np.argwhere(tops):
        reach = TOUCHED_SHARE * radius * min(1.0, np.sqrt(smooth[row, column] / radius))
        if (inside := _cap(height, column, row, radius, reach)) is not None:
            at, shape = inside
            yield _above_mean(pixel * shape, measured[at].astype(np.float64), stated[at])


def _cap(
    height: F8, x: float, y: float, radius: float, reach: float
) -> tuple[tuple[NDArray[np.intp], NDArray[np.intp]], F8] | None:
    """The pixels within `reach` of a ball's middle, and its height there, in px; None: cut off."""
    rows, columns = height.shape
    for _ in range(FIT_STEPS):
        if not (reach <= x <= columns - 1 - reach and reach <= y <= rows - 1 - reach):
            return None
        left, top = int(x - reach), int(y - reach)
        v, u = np.mgrid[top : int(y + reach) + 2, left : int(x + reach) + 2]
        near = (np.hypot(u - x, v - y) <= reach) & (v < rows) & (u < columns)
        at = v[near], u[near]
        dx, dy = at[1] - x, at[0] - y
        if len(dx) < MIN_POINTS or not np.isfinite(height[at]).all():
            return None
        shape = np.sqrt(radius**2 - dx * dx - dy * dy)
        terms = np.stack([dx / shape, dy / shape, np.ones_like(dx)], axis=1)
        step = np.linalg.lstsq(terms, height[at] - shape, rcond=None)[0]
        x, y = x + step[0], y + step[1]
    return at, shape
