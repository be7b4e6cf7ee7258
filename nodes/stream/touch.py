"""A touch: all that a graph knows of it, for the nodes that write or show it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from tactograph.graph import Port
from tactograph.nodes import (
    F4,
    U1,
    Confidence,
    Contacts,
    Height,
    HeightError,
    Labels,
    Lens,
    Light,
    Metrics,
    PixelSize,
    Vergence,
)
from tactograph.nodes.marker.find_markers import Markers
from tactograph.nodes.stream.frames import LiveState

RECORDED_AGE_S = 10.0
"""Age from which a touch comes from a recording, whose clock is another."""
_TAKEN_AS = {
    **dict.fromkeys(("name", "time", "state"), "frames"),
    **dict.fromkeys(("lens", "camera"), "view"),
    **dict.fromkeys(("markers", "shift", "seen"), "tracks"),
}


Shifts = Annotated[F4, Port("M 2", "px")]
"""The shift of each marker, x and y."""


Seen = Annotated[U1, Port("M", "flag", high=1)]
"""0: a marker is not seen; its shift is predicted from its neighbours."""


class MarkerTracks(NamedTuple):
    """The markers of the untouched film, and where each has gone."""

    markers: Markers
    shift: Shifts
    seen: Seen


@dataclass(frozen=True)
class Touch:
    """A touch: the inputs of `join_touch`, in its units; None for those that its graph lacks."""

    height: Height
    image: Light
    pixel: PixelSize
    name: str = ""
    time: float | None = None
    state: LiveState | None = None
    shadow: Labels | None = None
    highlight: Labels | None = None
    confidence: Confidence | None = None
    metrics: Metrics | None = None
    contact: Contacts | None = None
    error: HeightError | None = None
    lens: Lens | None = None
    camera: Vergence | None = None
    tracks: MarkerTracks | None = None

    def latency_s(self, now: float) -> float | None:
        """Return the time since the exposure; None if unknown, or a recording's."""
        age_s = RECORDED_AGE_S if self.time is None else now - self.time
        return age_s if 0 <= age_s < RECORDED_AGE_S else None


def now_in_touch(*names: str) -> dict[str, str]:
    """Return advice on inputs that are parts of a touch, by name."""
    return {
        name: f"'op: join_touch' takes it as '{_TAKEN_AS.get(name, name)}', and this node takes "
        "the result as 'touch'"
        for name in names
    }
