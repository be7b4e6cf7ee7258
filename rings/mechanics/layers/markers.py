"""The markers of the untouched film, and where each has gone."""

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.rings.mechanics.nodes.marker.find_markers import Markers
from tactograph.sdk import F4, Arrows, LayerKind, Port, Touch

Shifts = Annotated[F4, Port("M 2", "px")]
"""The shift of each marker, x and y."""


Visible = Annotated[NDArray[np.uint8], Port("M", "flag", high=1)]
"""0: a marker is not seen; its shift is predicted from its neighbours."""


class MarkerTracks(NamedTuple):
    """The markers of the untouched film, and where each has gone."""

    markers: Markers
    shift: Shifts
    visible: Visible


def _points(touch: Touch, tracks: MarkerTracks) -> Mapping[str, Any]:
    """Return one point per marker: its position on the untouched film, and its shift."""
    side = touch.pixel / 1e3
    (x, y, radius), (dx, dy) = side * tracks.markers.T, side * tracks.shift.T
    return {
        "x": x,
        "y": y,
        "z": 0 * x,
        "dx": dx,
        "dy": dy,
        "radius": radius,
        "visible": tracks.visible,
    }


def _arrows(touch: Touch, tracks: MarkerTracks) -> Arrows:
    """From each marker's place on the untouched film."""
    return Arrows(tracks.markers[:, :2], tracks.shift, tracks.visible)


KIND = LayerKind(MarkerTracks, _arrows, topics={"markers": _points})
