"""Where markers are: in the image, and on the film in mm."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.rings.mechanics.layers.markers import MarkerTracks
from tactograph.sdk import F8, Height, View


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
    view = view or View()
    half = view.unit(height.shape)
    rows, columns = height.shape
    middle = np.array([columns - 1, rows - 1]) / 2
    rest = tracks.markers[:, :2] - middle
    away = rest + tracks.shift
    u, v = away.T / half
    # Markers are found without the lens's distortion, heights with it.
    bent = np.asarray(view.offset(u, v))
    column, row = np.rint(away.T + half * bent + middle[:, None]).astype(int)
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    at = row * inside, column * inside
    z = height[at].astype(np.float64)
    nearer = 1 - z * (view.camera or 0.0)
    place = np.column_stack([pixel * away * nearer[:, None], z])
    return MarkerPlaces(at, inside, place, pixel * rest)
