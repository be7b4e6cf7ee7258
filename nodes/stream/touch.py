"""A touch: all that a graph knows of it, for the nodes that write or show it."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

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
from tactograph.nodes.stream.frames import LiveState
from tactograph.rings.mechanics.nodes.marker.find_markers import Markers

RECORDED_AGE_S = 10.0
"""Age from which a touch comes from a recording, whose clock is another."""
_TAKEN_AS = {
    **dict.fromkeys(("image", "name", "time", "state"), "frames"),
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


Pose = Annotated[F4, Port("6", "mm, deg")]
"""Shift x, y, z and turn vector x, y, z of the object, about the image's middle on the film at
rest.  A turn about z is positive from x to y."""


PoseCovariance = Annotated[F4, Port("6 6", "mm, deg")]
"""Covariance of the pose's six numbers; turns about the film's axes."""


class ObjectPose(NamedTuple):
    """The motion of the touched object since the touch began."""

    pose: Pose
    covariance: PoseCovariance


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
    pose: ObjectPose | None = None

    def latency_s(self, now: float) -> float | None:
        """Return the time since the exposure; None if unknown, or a recording's."""
        age_s = RECORDED_AGE_S if self.time is None else now - self.time
        return age_s if 0 <= age_s < RECORDED_AGE_S else None

    def object_frame(self, moved: ObjectPose) -> NDArray[np.float64]:
        """Return the object's frame, 4 x 4 in mm from the middle of the first pixel.

        It lay in the image's middle when the touch began.
        """
        rows, columns = self.height.shape
        frame = np.eye(4)
        frame[:3, :3], _ = cv2.Rodrigues(np.radians(moved.pose[3:], dtype=np.float64))
        frame[:3, 3] = moved.pose[:3] + self.pixel * np.array([columns - 1, rows - 1, 0]) / 2
        return frame


def now_in_touch(*names: str) -> dict[str, str]:
    """Return advice on inputs that are parts of a touch, by name."""
    return {
        name: f"'op: join_touch' takes it as '{_TAKEN_AS.get(name, name)}', and this node takes "
        "the result as 'touch'"
        for name in names
    }
