"""Follow the markers of a film under a touch."""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tactograph.rings.mechanics.layers.markers import MarkerTracks, Shifts
from tactograph.rings.mechanics.nodes.marker.find_markers import Markers, find_markers
from tactograph.rings.mechanics.nodes.marker.marker_darkness import Darkness
from tactograph.sdk import F4, F8, InputError, PixelSize, node

NEIGHBOUR_PITCHES = 1.6
"""Distance, in pitches, within which markers move alike."""
MAX_RIM_SHIFT_PITCHES, RIM_PITCHES = 0.25, 1.5
"""Largest shift of a marker near the rim of the grid, and what counts as near, in pitches."""
MAX_MEAN_NEIGHBOURS = 3
"""Up to this many neighbours predict a shift by their mean; more, by a plane."""


class Tracks(NamedTuple):
    """The tracks of the markers, and the figures."""

    tracks: MarkerTracks
    quality: dict[str, float]


@node
def track_markers(
    darkness: Darkness,
    markers: Markers,
    pixel: PixelSize,
    before: Shifts | None = None,
    *,
    dark: Annotated[float, Interval(ge=0.01, le=1)] = 0.15,
    farthest: Annotated[float, Gt(0)] = 0.45,
) -> Tracks:
    """Return the shift of each marker of the untouched film.

    The markers under the touch are found by `find_markers`.  A grid looks the same after a
    shift by one pitch, so the nearest spot need not be the right one.  The film at the rim of
    the grid is assumed to have moved little.  From there on each marker is searched where the
    known shifts of its neighbours predict it, markers with most known neighbours first.  In a
    stream the previous shifts predict where all markers are.

    Parameters
    ----------
    darkness : H x W of the touch, as `marker_darkness` gives it
    markers : M x 3 in px, of the untouched film
    pixel : mm per px
    before : M x 2 in px, the shifts of the previous item
    dark : as for `find_markers`
    farthest : largest distance from a marker's predicted to its found place, in pitches

    Returns
    -------
    The markers; their shifts M x 2 in px; which of them are seen; as figures ``markers``, how many
    there are, ``visible_markers_percent``, ``marker_shift_mm``, the longest, and
    ``marker_shift_mean_mm``.

    Raises
    ------
    InputError
        If the untouched film has no markers.
    """
    spots = find_markers(darkness, dark=dark)[:, :2].astype(np.float64)
    places = markers[:, :2].astype(np.float64)
    if len(places) < 2:
        # Dark film on a touch would be taken for markers, and filled in.
        raise InputError(
            "the film at rest shows no markers; for such a film take graph and overlays without "
            "markers, slip and shear, or, if it has some, set marker_px to slightly more than the "
            "width of one"
        )
    if not len(spots):
        still, unseen = np.zeros((len(places), 2), np.float32), np.zeros(len(places), np.uint8)
        return Tracks(MarkerTracks(markers, still, unseen), _figures(still, unseen, pixel))
    distances = np.asarray(cKDTree(places).query(places, 2)[0])
    pitch = float(np.median(distances[:, 1]))
    start = None if before is None or before.shape != (len(places), 2) else before.astype(float)
    shift, matched = _follow(places, spots, pitch, farthest * pitch, start)
    tracks = MarkerTracks(markers, shift.astype(np.float32), matched)
    return Tracks(tracks, _figures(shift, matched, pixel))


def _figures(shift: F8 | F4, matched: NDArray[np.generic], pixel: float) -> dict[str, float]:
    length = np.hypot(shift[:, 0], shift[:, 1])[np.asarray(matched) > 0] * pixel
    return {
        "markers": float(len(shift)),
        "visible_markers_percent": 100 * float(np.mean(np.asarray(matched) > 0)),
        "marker_shift_mm": float(length.max(initial=0)),
        "marker_shift_mean_mm": float(length.mean()) if length.size else 0.0,
    }


def _follow(
    places: F8, spots: F8, pitch: float, farthest: float, before: F8 | None
) -> tuple[F8, NDArray[np.uint8]]:
    """Match markers with spots, proceeding from sure markers to their neighbours."""
    tree, is_assigned = cKDTree(spots), np.zeros(len(spots), bool)
    pairs = cKDTree(places).query_pairs(NEIGHBOUR_PITCHES * pitch, output_type="ndarray")
    near = np.zeros((len(places), len(places)), bool)
    near[pairs[:, 0], pairs[:, 1]] = near[pairs[:, 1], pairs[:, 0]] = True
    shift, is_settled = np.zeros_like(places), np.zeros(len(places), bool)
    matched = np.zeros(len(places), np.uint8)

    def settle(i: int, expected: F8, most: float) -> None:
        away, spot = tree.query(places[i] + expected)
        matched[i] = away < most and not is_assigned[spot]
        shift[i] = spots[spot] - places[i] if matched[i] else expected
        is_assigned[spot] |= bool(matched[i])

    if before is None:
        inwards = np.minimum(places - places.min(axis=0), places.max(axis=0) - places).min(axis=1)
        for i in np.flatnonzero(inwards < RIM_PITCHES * pitch).tolist():
            settle(i, np.zeros(2), MAX_RIM_SHIFT_PITCHES * pitch)
        is_settled |= matched > 0
    if not is_settled.any():
        # The whole film has moved: the nearest spots are the only start.
        for i, expected in enumerate(np.zeros_like(places) if before is None else before):
            settle(i, expected, farthest)
        is_settled[:] = True
    sure = near[:, is_settled].sum(axis=1)
    while not is_settled.all():
        i = int(np.where(is_settled, -1, sure).argmax())
        settle(i, _expected(places, shift, i, np.flatnonzero(near[i] & is_settled)), farthest)
        is_settled[i] = True
        sure += near[i]
    return shift, matched


def _expected(places: F8, shift: F8, i: int, sure: NDArray[np.intp]) -> F8:
    """A plane through the neighbours' shifts, or their mean where they are few."""
    if not len(sure):
        return np.zeros(2)
    if len(sure) <= MAX_MEAN_NEIGHBOURS:
        return np.asarray(shift[sure].mean(axis=0))
    offsets = places[sure] - places[i]
    scale = float(np.abs(offsets).max())
    design = np.column_stack([np.ones(len(sure)), offsets / scale])
    damping = np.diag([0.0, 0.3, 0.3])
    plane = np.linalg.solve(design.T @ design + damping, design.T @ shift[sure])
    return np.asarray(plane[0])
