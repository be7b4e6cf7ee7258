"""A touch as ROS 2 messages, for `write_mcap` and `publish_ros2`.

Lengths are in metres, angles in radians.  The origin lies in the middle of the first pixel, on
the film at rest: x right, y down, z towards the camera.
"""

from __future__ import annotations

import time as clock
from typing import NamedTuple

import numpy as np

from tactograph.graph import Provenance
from tactograph.nodes import F8, Contacts, Height, Labels, Light, Metrics
from tactograph.nodes.files.ros_messages import (
    MM,
    Message,
    cloud_message,
    diagnostics_message,
    image_message,
    text_message,
)
from tactograph.nodes.marker.find_markers import Markers
from tactograph.nodes.marker.track_markers import Seen, Shifts

FRAME = "film"
"""ROS's name of the coordinate system."""
FULL_SCALE = 255


class TouchParts(NamedTuple):
    """The parts of a touch; None for those that its graph does not provide.

    As in `write_mcap`; `metrics` holds the figures of `measure_contact`.
    """

    height: Height
    image: Light
    pixel: float
    name: str
    shadow: Labels | None
    contact: Contacts | None
    metrics: Metrics | None
    markers: Markers | None
    shift: Shifts | None
    seen: Seen | None


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
    stamp: int, touch: TouchParts, points_step: int, provenance: Provenance
) -> list[Message]:
    """All messages of a touch, with the same stamp; its name comes last."""
    figures = {f"{step['node']} / ms": step["ms"] for step in provenance.nodes}
    figures |= touch.metrics or {}
    leds = (
        image_message(f"/led{k}/image", stamp, _eight_bit(plane), f"led{k}")
        for k, plane in enumerate(touch.image, start=1)
    )
    labels = {"/shadow": touch.shadow, "/contact": touch.contact}
    return [
        *leds,
        image_message("/height", stamp, touch.height * np.float32(MM), FRAME),
        *(image_message(at, stamp, each, FRAME) for at, each in labels.items() if each is not None),
        *_surface(stamp, touch, points_step),
        *_contacts(stamp, touch),
        *_markers(stamp, touch),
        diagnostics_message("/diagnostics", stamp, "tactograph", provenance.warnings, figures),
        text_message("/touch", stamp, touch.name),
    ]


def _surface(stamp: int, touch: TouchParts, step: int) -> list[Message]:
    if not step:
        return []
    height = touch.height[::step, ::step]
    rows, columns = height.shape
    side = step * touch.pixel * MM
    places = {"x": np.arange(columns) * side, "y": np.arange(rows)[:, None] * side}
    return [cloud_message("/points", stamp, {**places, "z": height * np.float32(MM)}, FRAME)]


def _contacts(stamp: int, touch: TouchParts) -> list[Message]:
    """One point per contact, from number 1: its centroid, with its depth as z."""
    figures = touch.metrics or {}
    if "contacts" not in figures:
        return []

    def each(name: str, unit: float) -> F8:
        # A number that no pixel has comes without figures.
        numbers = range(1, int(figures["contacts"]) + 1)
        return unit * np.array([figures.get(f"contact_{name}/c{n}", np.nan) for n in numbers])

    side = touch.pixel * MM
    fields = {
        "x": each("x_px", side),
        "y": each("y_px", side),
        "z": each("depth_mm", MM),
        "mean_depth": each("mean_depth_mm", MM),
        "area": each("area_mm2", MM**2),
        "volume": each("volume_mm3", MM**3),
        "major": each("major_mm", MM),
        "minor": each("minor_mm", MM),
        "angle": each("angle_deg", np.pi / 180),
    }
    return [cloud_message("/contacts", stamp, fields, FRAME)]


def _markers(stamp: int, touch: TouchParts) -> list[Message]:
    """One point per marker: its position on the untouched film, and its shift."""
    if touch.markers is None or touch.shift is None:
        return []
    side = touch.pixel * MM
    (x, y, radius), (dx, dy) = side * touch.markers.T, side * touch.shift.T
    seen = np.ones(len(x)) if touch.seen is None else touch.seen
    fields = {"x": x, "y": y, "z": 0 * x, "dx": dx, "dy": dy, "radius": radius, "seen": seen}
    return [cloud_message("/markers", stamp, fields, FRAME)]


def _eight_bit(plane: Light) -> Labels:
    scaled = np.clip(np.rint(plane * np.float32(FULL_SCALE)), 0, FULL_SCALE)
    return np.asarray(scaled, np.uint8)
