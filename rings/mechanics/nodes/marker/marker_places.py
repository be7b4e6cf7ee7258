"""Where markers are: in the image, and on the film in mm."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.rings.mechanics.layers.markers import MarkerTracks
from tactograph.sdk import F8, Height, View
from tactograph.sdk.unstable import camera_offset, half_diagonal


class MarkerPlaces(NamedTuple):
    """Of M markers: the pixel that shows each, and where it is in mm from the image's middle."""

    pixel: tuple[NDArray[np.int_], NDArray[np.int_]]
    """Row and column; 0, 0 outside the image."""
    inside: NDArray[np.bool_]
    place: F8
    """M x 3: x, y, z."""
    rest: F8
    """M x 2: x, y on the film at rest."""


def marker_places(
    height: Height, tracks: MarkerTracks, pixel: float, view: View | None
) -> MarkerPlaces:
    """Place the markers on the film, `height` as seen by the camera (V1)."""
    lens, camera = view or View()
    half = float(half_diagonal(height.shape))
    rows, columns = height.shape
    middle = np.array([columns - 1, rows - 1]) / 2
    rest = tracks.markers[:, :2] - middle
    away = rest + tracks.shift
    u, v = away.T / half
    # Markers are found without the lens's distortion, heights with it.
    bent = np.zeros((2, 1)) if lens is None else camera_offset(lens, u, v)
    column, row = np.rint(away.T + half * np.asarray(bent) + middle[:, None]).astype(int)
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    at = row * inside, column * inside
    z = height[at].astype(np.float64)
    nearer = 1 - z * (camera or 0.0)
    place = np.column_stack([pixel * away * nearer[:, None], z])
    return MarkerPlaces(at, inside, place, pixel * rest)
