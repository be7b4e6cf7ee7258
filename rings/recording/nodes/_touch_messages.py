"""A touch as ROS 2 messages, for `write_mcap` and `publish_ros2`.

Lengths are in metres, angles in radians.  The origin lies on the film at rest, in the middle of
the first pixel of an even grid: x right, y down, z towards the camera.  Points, contacts, markers
and poses lie where they are on the film; images are as the camera sees them.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.constants import milli
from scipy.spatial.transform import Rotation

from tactograph.rings.frames.colour_planes import in_bytes
from tactograph.rings.recording.files.ros_messages import (
    FILM_FRAME,
    Message,
    cloud_message,
    diagnostics_message,
    image_message,
    pose_message,
    text_message,
)
from tactograph.sdk import Axes, Provenance, Touch


def touch_messages(
    stamp: int, touch: Touch, points_step: int, provenance: Provenance
) -> list[Message]:
    """Return all messages of a touch, with the same stamp; its name comes last."""
    figures = {f"{step['node']} / ms": step["ms"] for step in provenance.nodes}
    figures |= touch.metrics or {}
    leds = (
        image_message(f"/led{k}/image", stamp, plane, f"led{k}")
        for k, plane in enumerate(in_bytes(touch.image), start=1)
    )
    height = touch.height * np.float32(milli)
    return [
        *leds,
        image_message("/height", stamp, height, FILM_FRAME),
        *_surface(stamp, touch, points_step),
        *_layers(stamp, touch),
        diagnostics_message(stamp, provenance.warnings, figures),
        text_message("/touch", stamp, touch.name),
    ]


def _surface(stamp: int, touch: Touch, step: int) -> list[Message]:
    if not step:
        return []
    places: tuple[NDArray[Any], ...] = (*touch.places_mm(step), touch.film[::step, ::step])
    fields = {axis: milli * place for axis, place in zip("xyz", places, strict=True)}
    return [cloud_message("/points", stamp, fields)]


def _layers(stamp: int, touch: Touch) -> list[Message]:
    """The messages of a touch's layers."""
    return [
        _message(f"/{topic}", stamp, carried)
        for layer in touch.each_layer()
        for topic, carries in layer.kind.topics.items()
        if (carried := carries(touch, layer.value) if carries else layer.value) is not None
    ]


def _message(topic: str, stamp: int, carried: NDArray[Any] | Mapping[str, Any] | Axes) -> Message:
    """The message of what a `Topic` returns."""
    if isinstance(carried, np.ndarray):
        return image_message(topic, stamp, carried, FILM_FRAME)
    if not isinstance(carried, Axes):
        return cloud_message(topic, stamp, carried)
    units = np.array([milli] * 3 + [np.pi / 180] * 3)
    turn = units[3:] * carried.turn
    quaternion = Rotation.from_rotvec(turn).as_quat()
    spread = carried.covariance * np.outer(units, units)
    return pose_message(topic, stamp, milli * carried.place, quaternion, spread)
