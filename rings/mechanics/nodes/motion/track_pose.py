"""Motion of the touched object since the touch began.

Long because film that hangs, a key frame and jumps are steps that nothing else needs.
"""

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from tactograph.rings.mechanics.layers.pose import POSE_NAMES, Pose, PoseCovariance
from tactograph.rings.mechanics.nodes.marker.bare_variance import SlopeVariance
from tactograph.rings.mechanics.nodes.motion._held_film import held_film
from tactograph.rings.mechanics.nodes.motion._match_shifts import Spectra, resolves
from tactograph.rings.mechanics.nodes.motion._rigid_fit import MIN_PAIRS, OPEN_MM, Fit, fit_motion
from tactograph.rings.mechanics.nodes.motion._surface import (
    IN_DEGREES,
    Surface,
    carried,
    cross_matrix,
    six_numbers,
    small_motion,
    surface_of,
)
from tactograph.sdk import F4, F8, Contacts, Height, PixelSize, Port, View, node, warn

KeySurface = Annotated[F4, Port("2 H W", "mm", nan=True)]
"""Heights of the key frame, NaN beside the touched film, and beside what moves with the object."""
Memory = Annotated[F4, Port("9 6", "mm, rad")]
"""Rows 0 to 5: covariance of the key frame's pose; then `ROW_KEY`, `ROW_SINCE`, `ROW_COUNTS`."""
ROW_KEY, ROW_SINCE, ROW_COUNTS = 6, 7, 8
"""Motion from the first frame to the key frame, and on to the frame before; frames, key frames,
and the variance of the key frame's slopes (0: not stated)."""
LEAST_SHARE = 0.5
"""Share of a point of the even grid that is contact, from which it counts."""
MAX_CELLS = 15_000
"""Touched cells from which larger ones do, where they resolve the contacts."""
SPARSE_PX = 3
"""Distance of the pixels whose stated variances are looked at."""
JUMP_CELLS, MAX_JUMPS = 2, 2
"""Side of the cells on which a jump is looked for, in fine ones, and how many are tried; small
contacts need fine ones."""
MAX_JUMP_DEG, MIN_JUMP_OVERLAP = 15.0, 0.3
"""Largest turn of a jump about z, and the least share of the smaller contact seen after it."""
TIGHT_SHARE = 0.25
"""Share of the raised film that curves down below which the film hides a tilt."""
OPEN_SHARE = 0.3
"""Share of an axis that lies in the unobservable motions."""


class TrackedPose(NamedTuple):
    """A pose with its covariance, the state for the next frame, and figures."""

    pose: Pose
    covariance: PoseCovariance
    key: KeySurface
    memory: Memory
    figures: dict[str, float]


@node
def track_pose(
    height: Height,
    contact: Contacts,
    pixel: PixelSize,
    variance: SlopeVariance | None = None,
    key: KeySurface | None = None,
    memory: Memory | None = None,
    view: View | None = None,
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
    height : H x W in mm, on an even grid: an ideal lens
    contact : H x W, as `find_contact` gives it
    pixel : mm per px
    variance
        2 x H x W, of the slopes that the height was integrated from; without it the covariance
        follows from what the fit leaves.
    key, memory : this node's own ``key`` and ``memory`` of the frame before (``previous.NODE.key``)
    view
        The calibration, for D, the height of the camera's pupil above the film: a point of height z
        is seen 1 / (1 - z / D) as far from the middle as it lies (V1).  Its lens does not count.
    cell_px
        Side of the finest cells: 1, 2, 4 or 8 px; 0: so many that 15,000 of them or fewer are
        touched, but 2 at least, and so few that the contacts are many cells wide.
    margin_px : width of the contact's rim that is left out, beside the film that hangs there
    least_overlap : share of the smaller contact

    Returns
    -------
    The pose 6 and its covariance 6 x 6, and figures: ``pose_x_mm``, ``pose_turn_x_deg``,
    ``pose_sd_x_mm`` and so on; ``pose_open``, how many motions are open, and which, as
    ``pose_open/turn_x``; ``pose_overlap``; ``pose_sure``, 0 where frame and key frame differ by
    more than both err, with a warning; ``pose_pressed``, the share of the raised film that
    curves down, as film does that an object holds: below 0.25 the film is so tight that it hides
    tilts, with a warning; ``pose_frames`` since tracking began; ``pose_keys``.
    """
    if view is not None and view.camera:
        near, touched = View(camera=view.camera), (contact > 0).astype(np.float32)
        height, (share,) = near.on_even_grid(height, [touched])
        height, contact = np.nan_to_num(height), (share > LEAST_SHARE).view(np.uint8)
    heights, pressed = held_film(height, contact, margin_px)
    stated, inside = 0.0, np.isfinite(heights[1, ::SPARSE_PX, ::SPARSE_PX])
    if variance is not None and inside.any():
        stated = float(np.median(variance[:, ::SPARSE_PX, ::SPARSE_PX][:, inside]))
    if key is None or memory is None:
        return _begin(heights, stated, pressed)
    fit, shared = _fit(key, memory, heights, stated, pixel, cell_px, pressed)
    if fit is None or shared < least_overlap / 2:
        return _begin(heights, stated, pressed)
    key_motion = small_motion(memory[ROW_KEY].astype(np.float64))
    pose = fit.motion @ key_motion
    onwards = carried(fit.motion)
    covariance = onwards @ memory[:6].astype(np.float64) @ onwards.T + fit.covariance
    counts = memory[ROW_COUNTS] + np.array([1, 0, 0, 0, 0, 0], np.float32)
    if shared < least_overlap:
        counts[1:3] = counts[1] + 1, stated
        new_memory = _memory(covariance, six_numbers(pose), np.zeros(6), counts)
        key = heights
    else:
        new_memory = _memory(memory[:6], memory[ROW_KEY], six_numbers(fit.motion), counts)
    if pressed < TIGHT_SHARE:
        warn(
            "track_pose: the film is tight and hangs between few tops of what touches it (figure "
            "'pose_pressed'): tilts are found too small, by a tenth or more"
        )
    if not (fit.sure or fit.open.size):
        warn(
            "track_pose: the touched surface differs from the key frame's by more than both err; "
            "where the figure 'pose_sure' is 0 the pose may be wrong"
        )
    figures = {"pose_overlap": shared, "pose_sure": float(fit.sure), "pose_pressed": pressed}
    return _tracked(pose, covariance, key, new_memory, fit.open, figures)


def _fit(
    key: F4, memory: F4, heights: F4, stated: float, pixel: float, cell_px: int, pressed: float
) -> tuple[Fit | None, float]:
    """The motion since the key frame, and the share of the smaller contact that both see."""
    before, now = (int(np.isfinite(plane).sum()) for plane in (key[1], heights[1]))
    fewest = min(before, now)
    finest = cell_px or _cell_px(heights, fewest)
    variance = float(memory[ROW_COUNTS, 2])
    (one, first), (other, second) = (
        [surface_of(plane, doubt or None, pixel).coarser(finest) for plane in planes]
        for planes, doubt in ((key, variance), (heights, stated))
    )
    fit = fit_motion(first, second, _guesses(one, other, memory[ROW_SINCE]), pressed)
    return fit, min(1.0, fit.overlap * before / max(fewest, 1)) if fit else 0.0


def _cell_px(heights: F4, fewest: int) -> int:
    """Side of the cells: larger where more film is touched, as far as they resolve contacts."""
    side, whole = 2, surface_of(heights[0], None, 1.0)
    while side < 8 and fewest >= MAX_CELLS * side**2 and resolves(whole.coarser(2 * side)):
        side *= 2
    return side


def _guesses(first: Surface, second: Surface, since: F4) -> Iterator[F8]:
    """The motion so far, and where the surfaces may be after a jump."""
    yield small_motion(since.astype(np.float64))
    factor = JUMP_CELLS if resolves(second.coarser(JUMP_CELLS)) else 1
    one, other = (surface.coarser(factor) for surface in (first, second))
    if one.touched.any() and other.touched.any():
        (jump,) = Spectra(one).matches([Spectra(other)], MAX_JUMP_DEG, MIN_JUMP_OVERLAP)
        yield from jump.motions[:MAX_JUMPS]


def _memory(covariance: F4 | F8, key: F4 | F8, since: F4 | F8, counts: F4) -> F4:
    return np.vstack([covariance, key, since, counts]).astype(np.float32)


def _begin(heights: F4, stated: float, pressed: float) -> TrackedPose:
    """The first frame of a touch, or one without a touch."""
    begins, zero = np.count_nonzero(np.isfinite(heights[1])) >= MIN_PAIRS, np.zeros((6, 6))
    counts = np.array([begins, begins, stated, 0, 0, 0], np.float32)
    memory = _memory(zero, zero[0], zero[0], counts)
    unknown = zero if begins else OPEN_MM**2 * np.eye(6)
    figures = {"pose_overlap": float(begins), "pose_sure": 1.0, "pose_pressed": pressed}
    return _tracked(np.eye(4), unknown, heights, memory, np.zeros((6, 0)), figures)


def _tracked(
    motion: F8, covariance: F8, key: F4, memory: F4, is_open: F8, further: dict[str, float]
) -> TrackedPose:
    """The pose in mm and degrees, its figures, and a warning of unobservable motions."""
    pose = IN_DEGREES * six_numbers(motion)
    # The shift is that of the film's origin: a turn about it after the motion moves it on.
    at_pose = np.eye(6)
    at_pose[:3, 3:] = -cross_matrix(motion[:3, 3])
    spread = np.diag(IN_DEGREES) @ at_pose
    covariance = spread @ covariance @ spread.T
    figures: dict[str, float] = {}
    for axis, value, deviation in zip(POSE_NAMES, pose, np.sqrt(np.diag(covariance)), strict=True):
        figures[f"pose_{axis}"], figures[f"pose_sd_{axis}"] = float(value), float(deviation)
    figures["pose_open"] = float(is_open.shape[1])
    for axis, share in zip(POSE_NAMES, np.square(is_open).sum(axis=1), strict=True):
        if share > OPEN_SHARE:
            figures[f"pose_open/{axis.rpartition('_')[0]}"] = 1.0
    figures |= further
    figures["pose_frames"], figures["pose_keys"] = (float(n) for n in memory[ROW_COUNTS, :2])
    if is_open.size:
        # The same words in each frame, so that a stream says it once.
        warn(
            "track_pose: the shape leaves motions open, which stay as they were; the figures "
            "'pose_open' say which"
        )
    return TrackedPose(pose.astype(np.float32), covariance.astype(np.float32), key, memory, figures)
