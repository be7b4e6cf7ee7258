"""A touch as ROS 2 messages, for `write_mcap` and `publish_ros2`.

Lengths are in metres, angles in radians.  The origin lies in the middle of the first pixel, on
the film at rest: x right, y down, z towards the camera.
"""

import time as clock

import numpy as np

from tactograph.rings.recording.files.ros_messages import (
    FILM_FRAME,
    METRES_PER_MM,
    Message,
    cloud_message,
    diagnostics_message,
    image_message,
    pose_message,
    text_message,
)
from tactograph.sdk import F8, Provenance, Touch

MAX_BYTE = 255


class TouchStamps:
    """Converts the camera's clock, ``time.monotonic()``, to nanoseconds since 1970.

    Parameters
    ----------
    follow
        Whether stamps follow a time of day that is set while they are given, as on a computer
        that learns it from the network.  If not, as in a recording, they go on as they began.
    """

    def __init__(self, *, follow: bool = False) -> None:
        self._follow = follow
        self._offset = _day_offset()

    def of(self, time: float | None) -> int:
        """The stamp of an exposure; the present time if the exposure's is unknown."""
        if self._follow:
            self._offset = _day_offset()
        exposed = clock.monotonic_ns() if time is None else round(1e9 * time)
        return exposed + self._offset


def _day_offset() -> int:
    return clock.time_ns() - clock.monotonic_ns()


def touch_messages(
    stamp: int, touch: Touch, points_step: int, provenance: Provenance
) -> list[Message]:
    """Return all messages of a touch, with the same stamp; its name comes last."""
    figures = {f"{step['node']} / ms": step["ms"] for step in provenance.nodes}
    figures |= touch.metrics or {}
    bytes_ = np.clip(np.rint(touch.image * np.float32(MAX_BYTE)), 0, MAX_BYTE).astype(np.uint8)
    leds = (
        image_message(f"/led{k}/image", stamp, plane, f"led{k}")
        for k, plane in enumerate(bytes_, start=1)
    )
    height = touch.height * np.float32(METRES_PER_MM)
    maps = {"/height": height, "/shadow": touch.shadow, "/contact": touch.contact}
    return [
        *leds,
        *(image_message(at, stamp, m, FILM_FRAME) for at, m in maps.items() if m is not None),
        *_surface(stamp, touch, points_step),
        *_contacts(stamp, touch),
        *_markers(stamp, touch),
        *_pose(stamp, touch),
        diagnostics_message(stamp, provenance.warnings, figures),
        text_message("/touch", stamp, touch.name),
    ]


def _surface(stamp: int, touch: Touch, step: int) -> list[Message]:
    if not step:
        return []
    height = touch.height[::step, ::step]
    rows, columns = height.shape
    side = step * touch.pixel * METRES_PER_MM
    places = {"x": np.arange(columns) * side, "y": np.arange(rows)[:, None] * side}
    fields = {**places, "z": height * np.float32(METRES_PER_MM)}
    return [cloud_message("/points", stamp, fields)]


def _contacts(stamp: int, touch: Touch) -> list[Message]:
    """One point per contact, from number 1: its centroid, with its depth as z."""
    figures = touch.metrics or {}
    if "contacts" not in figures:
        return []

    measured = [int(key.rpartition("/c")[2]) for key in figures if key.startswith("contact_x_px/")]
    numbers = range(1, max(measured, default=0) + 1)

    def each(name: str, unit: float) -> F8:
        # A number that no pixel has comes without figures.
        return unit * np.array([figures.get(f"contact_{name}/c{n}", np.nan) for n in numbers])

    side = touch.pixel * METRES_PER_MM
    fields = {
        "x": each("x_px", side),
        "y": each("y_px", side),
        "z": each("depth_mm", METRES_PER_MM),
        "mean_depth": each("mean_depth_mm", METRES_PER_MM),
        "area": each("area_mm2", METRES_PER_MM**2),
        "volume": each("volume_mm3", METRES_PER_MM**3),
        "major": each("major_mm", METRES_PER_MM),
        "minor": each("minor_mm", METRES_PER_MM),
        "angle": each("angle_deg", np.pi / 180),
        "cut": each("cut", 1),
    }
    return [cloud_message("/contacts", stamp, fields)]


def _markers(stamp: int, touch: Touch) -> list[Message]:
    """One point per marker: its position on the untouched film, and its shift."""
    if touch.tracks is None:
        return []
    markers, shift, seen = touch.tracks
    side = touch.pixel * METRES_PER_MM
    (x, y, radius), (dx, dy) = side * markers.T, side * shift.T
    fields = {"x": x, "y": y, "z": 0 * x, "dx": dx, "dy": dy, "radius": radius, "seen": seen}
    return [cloud_message("/markers", stamp, fields)]


def _pose(stamp: int, touch: Touch) -> list[Message]:
    """The object's own frame, which lay in the image's middle when the touch began."""
    if touch.pose is None:
        return []
    units = np.array([METRES_PER_MM] * 3 + [np.pi / 180] * 3)
    turn = units[3:] * touch.pose.pose[3:]
    half = np.linalg.norm(turn) / 2
    quaternion = np.array([*(np.sinc(half / np.pi) / 2 * turn), np.cos(half)])
    place = METRES_PER_MM * touch.object_frame(touch.pose)[:3, 3]
    spread = touch.pose.covariance * np.outer(units, units)
    return [pose_message(stamp, place, quaternion, spread)]
