"""Motion of the touched object since the touch began."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import cv2
import numpy as np
from annotated_types import Interval
from numpy.typing import NDArray

from tactograph.graph import Port, node, warn
from tactograph.nodes import F4, F8, Contacts, Height, Metrics, PixelSize, SlopeVariance
from tactograph.nodes.motion._rigid_fit import MIN_PAIRS, OPEN_MM, Fit, fit_motion
from tactograph.nodes.motion._surface import (
    IN_DEGREES,
    POSE_AXES,
    carried,
    six_numbers,
    small_motion,
    surface_of,
)
from tactograph.nodes.stream.touch import Pose, PoseCovariance

KeySurface = Annotated[F4, Port("H W", "mm", nan=True)]
"""The touched heights of the key frame; NaN elsewhere."""
Memory = Annotated[F4, Port("9 6", "mm, rad")]
"""Rows 0 to 5: covariance of the key frame's pose; then `ROW_KEY`, `ROW_SINCE`, `ROW_COUNTS`."""
ROW_KEY, ROW_SINCE, ROW_COUNTS = 6, 7, 8
"""Motion from the first frame to the key frame, and on to the frame before; frames, key frames,
and the variance of the key frame's slopes (0: not stated)."""
MAX_CELLS = 15_000
"""Touched cells from which larger ones do."""
SPARSE_PX = 3
"""Distance of the pixels whose stated variances are looked at."""
OPEN_SHARE = 0.3
"""Share of an axis that lies in the open motions."""


class TrackedPose(NamedTuple):
    """A pose with its covariance, the state for the next frame, and figures."""

    pose: Pose
    covariance: PoseCovariance
    key: KeySurface
    memory: Memory
    figures: Metrics


@node
def track_pose(
    height: Height,
    contact: Contacts,
    pixel: PixelSize,
    variance: SlopeVariance | None = None,
    key: KeySurface | None = None,
    memory: Memory | None = None,
    *,
    cell_px: Annotated[int, Interval(ge=0, le=8)] = 0,
    margin_px: Annotated[int, Interval(ge=0, le=100)] = 3,
    least_overlap: Annotated[float, Interval(ge=0.1, le=1)] = 0.6,
) -> TrackedPose:
    """Track the rigid motion of the object that presses against the film.

    The touched surface of a key frame is moved until its slopes and heights are those of the
    frame, by Gauss-Newton over the pixels that both see (R1).  Where the two share less than
    `least_overlap` of what is touched, the frame becomes the key frame, and its error stays in
    all later ones.  Where they share less than half of that, or nothing touches, tracking begins
    anew at zero.  All contacts count as one rigid object.

    A motion that leaves no trace (a ball turns unseen, a cylinder slides) stays as it was, and
    has a standard deviation of 100 mm; a warning and ``pose_open`` say so.  So has every motion
    while nothing touches.

    Parameters
    ----------
    height
        H x W in mm, on an even grid: an ideal lens.
    contact
        H x W, as `find_contact` gives it.
    pixel
        mm per px.
    variance
        2 x H x W, of the slopes that the height was integrated from; without it the covariance
        follows from what the fit leaves.
    key, memory
        This node's own ``key`` and ``memory`` of the frame before (``previous.NODE.key``).
    cell_px
        Side of the finest cells: 1, 2, 4 or 8 px; 0: so many that 15,000 of them or fewer are
        touched, but 2 at least.
    margin_px
        Width of the contact's rim that is left out: film bends there that does not touch.
    least_overlap
        Share of the smaller contact.

    Returns
    -------
    TrackedPose
        The pose 6 and its covariance 6 x 6, and figures: ``pose_x_mm``, ``pose_turn_x_deg``,
        ``pose_sd_x_mm`` and so on; ``pose_open``, how many motions are open, and which, as
        ``pose_open/turn_x``; ``pose_overlap``; ``pose_frames`` since tracking began;
        ``pose_keys``.
    """
    rim = np.ones((2 * margin_px + 1,) * 2, np.uint8)
    touched = cv2.erode((contact > 0).view(np.uint8), rim, borderValue=0) > 0
    stated = 0.0
    if variance is not None and touched.any():
        sparse = slice(None, None, SPARSE_PX), slice(None, None, SPARSE_PX)
        stated = float(np.median(variance[:, *sparse][:, touched[sparse]]))
    heights = np.where(touched, height, np.float32(np.nan))
    if key is None or memory is None:
        return _begin(heights, stated, touched)
    fit = _fit(key, memory, heights, stated, pixel, cell_px)
    shared = 0.0 if fit is None else _shared(fit, key, touched)
    if fit is None or shared < least_overlap / 2:
        return _begin(heights, stated, touched)
    begun = small_motion(memory[ROW_KEY].astype(np.float64))
    pose = fit.motion @ begun
    onwards = carried(fit.motion)
    covariance = onwards @ memory[:6].astype(np.float64) @ onwards.T + fit.covariance
    counts = memory[ROW_COUNTS] + np.array([1, 0, 0, 0, 0, 0], np.float32)
    if shared < least_overlap:
        counts[1:3] = counts[1] + 1, stated
        kept = _memory(covariance, six_numbers(pose), np.zeros(6), counts)
        key = heights
    else:
        kept = _memory(memory[:6], memory[ROW_KEY], six_numbers(fit.motion), counts)
    named = np.square(fit.open).sum(axis=1) > OPEN_SHARE
    return _tracked(pose, covariance, key, kept, named, fit, shared)


def _fit(
    key: F4,
    memory: F4,
    heights: F4,
    stated: float,
    pixel: float,
    cell_px: int,
) -> Fit | None:
    variances = float(memory[ROW_COUNTS, 2]) or None, stated or None
    masks = np.isfinite(key), np.isfinite(heights)
    fewest = min(np.count_nonzero(mask) for mask in masks)
    finest = cell_px or next((side for side in (2, 4) if fewest < MAX_CELLS * side**2), 8)
    first, second = (
        surface_of(plane, mask, doubt, pixel).coarser(finest)
        for plane, mask, doubt in zip((key, heights), masks, variances, strict=True)
    )
    return fit_motion(first, second, small_motion(memory[ROW_SINCE].astype(np.float64)))


def _shared(fit: Fit, key: F4, touched: NDArray[np.bool_]) -> float:
    """Share of the smaller contact that both frames see."""
    before, now = int(np.isfinite(key).sum()), int(touched.sum())
    return min(1.0, fit.overlap * before / max(min(before, now), 1))


def _memory(covariance: F4 | F8, key: F4 | F8, since: F4 | F8, counts: F4) -> F4:
    return np.vstack([covariance, key, since, counts]).astype(np.float32)


def _begin(heights: F4, stated: float, touched: NDArray[np.bool_]) -> TrackedPose:
    """The first frame of a touch, or one without a touch."""
    begins = np.count_nonzero(touched) >= MIN_PAIRS
    counts = np.array([begins, begins, stated, 0, 0, 0], np.float32)
    zero = np.zeros((6, 6))
    memory = _memory(zero, zero[0], zero[0], counts)
    unknown = zero if begins else OPEN_MM**2 * np.eye(6)
    return _tracked(np.eye(4), unknown, heights, memory, np.zeros(6, bool), None, float(begins))


def _tracked(
    motion: F8,
    covariance: F8,
    key: F4,
    memory: F4,
    named: NDArray[np.bool_],
    fit: Fit | None,
    shared: float,
) -> TrackedPose:
    """The pose in mm and degrees with its figures, and a warning of open motions."""
    pose = IN_DEGREES * six_numbers(motion)
    # The shift is that of the film's origin: a turn about it after the motion moves it on.
    at_pose = np.eye(6)
    at_pose[:3, 3:] = -carried(small_motion(np.array([*motion[:3, 3], 0, 0, 0])))[:3, 3:]
    spread = np.diag(IN_DEGREES) @ at_pose
    covariance = spread @ covariance @ spread.T
    figures: Metrics = {}
    for axis, value, deviation in zip(POSE_AXES, pose, np.sqrt(np.diag(covariance)), strict=True):
        figures[f"pose_{axis}"], figures[f"pose_sd_{axis}"] = float(value), float(deviation)
    count = 0 if fit is None else fit.open.shape[1]
    figures["pose_open"] = float(count)
    names = (
        axis.rpartition("_")[0] for axis, is_open in zip(POSE_AXES, named, strict=True) if is_open
    )
    figures |= {f"pose_open/{name}": 1.0 for name in names}
    figures["pose_overlap"] = shared
    figures["pose_frames"], figures["pose_keys"] = (float(n) for n in memory[ROW_COUNTS, :2])
    if count:
        # The same words in each frame, so that a stream says it once.
        warn(
            "track_pose: the shape leaves motions open, which stay as they were; the figures "
            "'pose_open' say which"
        )
    return TrackedPose(pose.astype(np.float32), covariance.astype(np.float32), key, memory, figures)
