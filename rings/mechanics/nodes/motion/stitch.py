"""One surface from many touches.

Long because pairs, poses and the fused height are three steps that nothing else needs.
"""

import math
import time
from itertools import product
from typing import Annotated, NamedTuple

import cv2
import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray

from tactograph.rings.mechanics.layers.pose import POSE_NAMES
from tactograph.rings.mechanics.nodes.force.elastic_layer import wave_numbers
from tactograph.rings.mechanics.nodes.motion._match_shifts import Match, Spectra
from tactograph.rings.mechanics.nodes.motion._pose_graph import Pair, solve_poses
from tactograph.rings.mechanics.nodes.motion._rigid_fit import fit_motion
from tactograph.rings.mechanics.nodes.motion._surface import (
    IN_DEGREES,
    Surface,
    cells_at,
    cross_matrix,
    normals,
    pulled_back,
    six_numbers,
    surface_of,
)
from tactograph.rings.mechanics.nodes.motion.read_touches import TouchHeights
from tactograph.sdk import F4, F8, InputError, PixelSize, Port, node, tell_progress, warn
from tactograph.sdk.nodes import find_contact

MIN_PARTNERS = 4
"""Others with which each touch is matched, besides the logarithm of their number: neighbours in a
row and a column."""
MATCHED_CELLS = 2
"""Side of the cells on which touches are matched, in fine ones."""
HEIGHT_STEPS = 4
"""Steps in which a height on a turned surface is found."""
MAX_CELLS = 10**8

Stitched = Annotated[F4, Port("Y X", "mm", nan=True)]
"""Surface on a grid of the touches' pixel size; NaN where nothing touched."""


Sources = Annotated[NDArray[np.uint8], Port("Y X", "touch number", high=255)]
"""The touch that counts most, from 1; 0: none."""


class StitchedSurface(NamedTuple):
    """Height, standard deviation, whose they are most, and figures."""

    height: Stitched
    error: Stitched
    source: Sources
    figures: dict[str, float]


@node
def stitch(
    heights: TouchHeights,
    errors: TouchHeights,
    pixel: PixelSize,
    names: list[str],
    *,
    turn_deg: Annotated[float, Interval(ge=0, le=180)] = 15.0,
    least_overlap: Annotated[float, Interval(ge=0.02, le=1)] = 0.15,
    least_likeness: Annotated[float, Interval(ge=0, le=1)] = 0.9,
    margin_px: Annotated[int, Interval(ge=0, le=100)] = 3,
    cell_px: Annotated[int, Interval(ge=1, le=8)] = 2,
    seconds: Annotated[float, Gt(0)] | None = None,
) -> StitchedSurface:
    """Put touches of one rigid object together.

    Any two touches are compared by the correlation of their curvature; the likeliest pairs of
    each touch, n log n in all, are then matched by Gauss-Newton (R1).  Poses are those of least
    squares over all pairs that share enough, loops included; pairs that contradict the others go.
    Where touches overlap, the height is their mean, weighted by 1 / error^2.  The error is that
    of the mean, times what touches differ by, in multiples of their errors, where that is above
    1; without stated errors that alone.

    Parameters
    ----------
    heights : P x H x W in mm, on even grids
    errors : P x H x W in mm, NaN where not stated
    pixel : mm per px
    names : of the P touches
    turn_deg : largest turn about z between two touches that is looked for
    least_overlap : share of the smaller contact that two touches must have in common
    least_likeness
        Share of the variance of one touch's slopes that the other must have, too; less than 0.9
        where slopes are noisy.
    margin_px : width of the contacts' rims that are left out
    cell_px : side of the finest cells on which touches are matched
    seconds : after which no further pair is tried; the likeliest come first

    Returns
    -------
    In the frame of the touch that has the most pairs; figures ``stitched_touches``,
    ``stitched_pairs``, ``stitched_area_mm2``, ``stitched_difference`` (of touches, in multiples of
    their errors), ``stitched_left_mm`` and ``stitched_top_mm`` (of the first cell, from that
    touch's middle), and the poses: ``stitched_x_mm/NAME``, ``stitched_turn_z_deg/NAME`` and so on,
    with ``stitched_unsure_mm/NAME``, the standard deviation of where the touch's corners lie.
    Above the cells on which touches are matched, which a warning tells, the shape leaves its
    motion open: a ball turns unseen, a cylinder slides.

    Raises
    ------
    InputError
        If no two touches fit.
    """
    touched = [_touched(*each, margin_px) for each in zip(heights, errors, strict=True)]
    nan = np.float32(np.nan)
    surfaces = [
        surface_of(np.where(mask, height, nan), _slope_variance(error, mask, pixel), pixel)
        for height, mask, error in zip(heights, touched, errors, strict=True)
    ]
    cells = [surface.coarser(cell_px) for surface in surfaces]
    end = math.inf if seconds is None else time.monotonic() + seconds
    pairs, untried = _matched(cells, turn_deg, least_overlap, least_likeness, end)
    poses, covariances, leans, pairs = solve_poses(len(names), pairs)
    if untried:
        warn(
            f"stitch: after `seconds`={seconds:g}, {untried} likely pairs of touches were left "
            "untried; allow more time, or take fewer touches"
        )
    if len(poses) < 2:
        raise InputError(
            f"stitch: no two of {len(names)} touches fit together; they need texture in common, "
            f"over {least_overlap:.0%} of the contact, turned by less than {turn_deg:g} degrees"
        )
    out = [name for number, name in enumerate(names) if number not in poses]
    if out:
        warn(f"stitch: touches that fit no other are left out: {', '.join(out)}")
    unsure = {n: _unsure_mm(surfaces[n], poses[n], covariances[n]) for n in sorted(poses)}
    lost = [
        names[n] for n, deviation in unsure.items() if deviation > MATCHED_CELLS * cells[n].side
    ]
    if lost:
        warn(
            "stitch: the shape, such as a ball's, leaves open how the object lay in these touches "
            f"beside the others, so their places are not stated: {', '.join(lost)}"
        )
    stated = all(np.isfinite(errors[n][touched[n]]).all() for n in poses)
    deviations = np.nan_to_num(errors) if stated else np.ones_like(errors)
    grid = _grid(surfaces, poses)
    height, error, astray, source, difference = _fused(surfaces, deviations, poses, leans, grid)
    error = np.hypot(error * np.float32(max(difference, 1.0) if stated else difference), astray)
    figures: dict[str, float] = {
        "stitched_touches": float(len(poses)),
        "stitched_pairs": float(len(pairs)),
        "stitched_area_mm2": float(np.isfinite(height).sum() * pixel**2),
        "stitched_left_mm": grid.left,
        "stitched_top_mm": grid.top,
    }
    if stated:
        figures["stitched_difference"] = difference
    for number, deviation in unsure.items():
        figures[f"stitched_unsure_mm/{names[number]}"] = deviation
        for axis, value in zip(POSE_NAMES, IN_DEGREES * six_numbers(poses[number]), strict=True):
            figures[f"stitched_{axis}/{names[number]}"] = float(value)
    return StitchedSurface(height, error, source, figures)


def _touched(height: F4, error: F4, margin_px: int) -> NDArray[np.bool_]:
    """Mask of film that touches the object: contacts without their rims."""
    is_known = np.isfinite(height)
    stated = np.nan_to_num(error) if np.isfinite(error[is_known]).all() else None
    contact = find_contact(np.nan_to_num(height), stated)
    rim = np.ones((2 * margin_px + 1,) * 2, np.uint8)
    inside = ((contact > 0) & is_known).view(np.uint8)
    return np.asarray(cv2.erode(inside, rim, borderValue=0) > 0)


def _slope_variance(error: F4, touched: NDArray[np.bool_], pixel: float) -> float | None:
    """Variance of the white slopes whose integral has the stated error; None where none is
    stated."""
    if not touched.any() or not np.isfinite(error[touched]).all():
        return None
    k = wave_numbers(error.shape, pixel)
    return float(np.median(error[touched]) ** 2 / np.mean(1 / k[k > 0] ** 2))


def _matched(
    cells: list[Surface], turn_deg: float, least_overlap: float, least_likeness: float, end: float
) -> tuple[list[Pair], int]:
    """The pairs of touches that fit, and how many were not tried when the time was over.

    All are correlated, which is cheap; the motion is fitted where the correlation is among the
    best of either touch, and the likeliest pair comes first.
    """
    sizes = [np.count_nonzero(surface.touched) for surface in cells]
    coarse = [surface.coarser(MATCHED_CELLS) for surface in cells]
    touching = [n for n, surface in enumerate(coarse) if surface.touched.any()]
    spectra = {number: Spectra(coarse[number]) for number in touching}
    likely: list[tuple[Match, int, int]] = []
    for place, first in enumerate(touching):
        tell_progress(f"touch {place + 1} of {len(touching)} compared with all others")
        later = touching[place + 1 :]
        others = [spectra[second] for second in later]
        matches = spectra[first].matches(others, turn_deg, least_overlap)
        likely += [(match, first, second) for match, second in zip(matches, later, strict=True)]
    likely.sort(key=lambda each: -each[0].score)
    most, partners = MIN_PARTNERS + math.ceil(math.log2(len(cells))), [0] * len(cells)
    candidates: list[tuple[Match, int, int]] = []
    for each in likely:
        if min(partners[n] for n in each[1:]) < most:
            candidates.append(each)
            for n in each[1:]:
                partners[n] += 1
    pairs: list[Pair] = []
    for number, (match, first, second) in enumerate(candidates):
        if time.monotonic() > end:
            return pairs, len(candidates) - number
        tell_progress(f"pair {number + 1} of {len(candidates)}, {len(pairs)} fit")
        least = least_overlap * min(sizes[first], sizes[second]) / sizes[first]
        # Contacts of a few cells, as of small balls, have no ring that is sure.
        fits = [fit_motion(cells[first], cells[second], [m], rings=False) for m in match.motions]
        good = [f for f in fits if f and f.likeness > least_likeness and f.overlap > least]
        if good:
            pairs.append(Pair(first, second, max(good, key=lambda f: f.likeness)))
    return pairs, 0


def _unsure_mm(surface: Surface, motion: F8, covariance: F8) -> float:
    """Largest standard deviation of where a touch's corners lie."""
    points = motion[:3, :3] @ surface.points() + motion[:3, 3:]
    corners = product(*zip(points.min(axis=1), points.max(axis=1), strict=True))
    moved = [np.hstack([np.eye(3), -cross_matrix(np.array(each))]) for each in corners]
    return float(np.sqrt(max(np.linalg.eigvalsh(m @ covariance @ m.T)[-1] for m in moved)))


def _fused(
    surfaces: list[Surface],
    deviations: F4,
    poses: dict[int, F8],
    leans: dict[int, F8],
    grid: Surface,
) -> tuple[F4, F4, F4, NDArray[np.uint8], float]:
    """Height, its deviation by the touches' errors and by their poses', the touch of most weight,
    and the touches' root mean square difference from their mean, in deviations.
    """
    weights, total, square, astray = (np.zeros(grid.height.shape) for _ in range(4))
    heaviest, source = np.zeros_like(weights), np.zeros(weights.shape, np.uint8)
    touch_count = np.zeros(weights.shape, np.int64)
    for number, pose in poses.items():
        height, weight = _turned(
            surfaces[number], deviations[number], np.asarray(np.linalg.inv(pose)), grid
        )
        weights += weight
        total += weight * height
        square += weight * height**2
        astray += weight * _height_deviation(height, leans[number], grid)
        touch_count += weight > 0
        source[weight > heaviest] = number + 1
        heaviest = np.maximum(heaviest, weight)
    is_covered = weights > 0
    mean = np.divide(total, weights, out=np.full_like(total, np.nan), where=is_covered)
    error = np.divide(1, weights, out=np.full_like(total, np.nan), where=is_covered) ** 0.5
    several = touch_count > 1
    apart = square[several] - weights[several] * mean[several] ** 2
    freedom = max(int((touch_count[several] - 1).sum()), 1)
    difference = float(np.sqrt(max(float(apart.sum()), 0.0) / freedom))
    astray = np.divide(astray, weights, out=np.zeros_like(total), where=is_covered)
    fused, deviation, of_poses = (p.astype(np.float32) for p in (mean, error, astray))
    return fused, deviation, of_poses, source, difference


def _height_deviation(height: F8, covariance: F8, grid: Surface) -> F8:
    """The deviation of heights by a small motion of this covariance (R1)."""
    (x, y), (a, b) = grid.places(), normals(height.astype(np.float32), grid.side)
    moved = np.broadcast_arrays(a, b, 1, y - height * b, height * a - x, x * b - y * a)
    square = np.einsum("iyx,ij,jyx->yx", moved, covariance, moved, optimize=True)
    return np.asarray(np.sqrt(np.maximum(square, 0)))


def _grid(surfaces: list[Surface], poses: dict[int, F8]) -> Surface:
    """Empty cells of the touches' size over all that is touched."""
    corners = []
    for number, pose in poses.items():
        points = pose[:2, :3] @ surfaces[number].points() + pose[:2, 3:]
        corners += [points.min(axis=1), points.max(axis=1)]
    side = surfaces[0].side
    left, top = np.min(corners, axis=0)
    columns, rows = (np.max(corners, axis=0) - (left, top)) // side + 2
    if rows * columns > MAX_CELLS:
        raise InputError(f"stitch: the touches lie {columns * side:.0f} mm apart; check them")
    empty = np.zeros((int(rows), int(columns)), np.float32)
    return Surface(empty, None, side, float(left), float(top))


def _turned(surface: Surface, deviation: F4, motion: F8, grid: Surface) -> tuple[F8, F8]:
    """A touch's height on the grid, and its weight, 0 where it does not touch."""
    x, y = grid.places()
    height, steepness = grid.height, np.stack([grid.height, grid.height])
    for _ in range(HEIGHT_STEPS):
        above = pulled_back(surface, motion, x, y, height, steepness)
        touched = np.isfinite(above)
        height = np.where(touched, height + above, np.float32(0))
        steepness = normals(height, grid.side)
    column, row, _ = cells_at(surface, motion, x, y, height)
    spread = cv2.remap(deviation, column, row, cv2.INTER_LINEAR)
    weight = np.divide(touched, spread**2, out=np.zeros(height.shape), where=spread > 0)
    return height.astype(np.float64), weight
