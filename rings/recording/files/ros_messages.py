"""ROS 2 messages as plain dictionaries, which Foxglove, Rerun and ``ros2 bag`` can read.

Lengths are in metres, as everywhere in ROS; times are nanoseconds since 1970.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.sdk import InputError

FILM_FRAME = "film"
"""ROS's name of the film's coordinate system."""
_GRAY_ENCODINGS = {"u1": "mono8", "u2": "mono16", "f4": "32FC1"}
_COLOUR_ENCODINGS = {"u1": "bgr8", "u2": "bgr16"}
"""Encodings of pictures with three channels, blue, green, red, as in OpenCV."""
_READ_ENCODINGS = {
    **{encoding: (kind, 1) for kind, encoding in _GRAY_ENCODINGS.items()},
    **{encoding: (kind, 3) for kind, encoding in _COLOUR_ENCODINGS.items()},
    # Other names that camera drivers use.
    "8UC1": ("u1", 1),
    "16UC1": ("u2", 1),
    "rgb8": ("u1", 3),
    "rgb16": ("u2", 3),
}
"""Element type and number of channels of the encodings that can be read."""
_FIELD_FLOAT32 = 7


@dataclass(frozen=True)
class Message:
    """One message to write or publish."""

    topic: str
    type: str
    time: int
    body: Mapping[str, Any] = field(repr=False)
    sequence: int = 0

    @property
    def size(self) -> int:
        """Approximate size in memory, in bytes."""
        return len(self.body.get("data", b"")) + 1000


def text_message(topic: str, time: int, text: str) -> Message:
    """A std_msgs/String."""
    # Separate JSON channels would make `ros2 bag play` refuse the whole file, because it requires
    # one serialisation for all topics.
    return Message(topic, "std_msgs/msg/String", time, {"data": text})


def image_message(
    topic: str, time: int, image: NDArray[Any], frame: str, sequence: int = 0
) -> Message:
    """A sensor_msgs/Image by the array's type: H x W is mono8, mono16 or 32FC1; H x W x 3 bgr."""
    rows, columns, *channels = image.shape
    encodings = _COLOUR_ENCODINGS if channels else _GRAY_ENCODINGS
    little = np.ascontiguousarray(image, image.dtype.newbyteorder("<"))
    body = {
        "header": _header(time, frame),
        "height": rows,
        "width": columns,
        "encoding": encodings[image.dtype.str[1:]],
        "is_bigendian": 0,
        "step": columns * image.itemsize * (3 if channels else 1),
        "data": little.tobytes(),
    }
    return Message(topic, "sensor_msgs/msg/Image", time, body, sequence)


def read_image(body: Any) -> NDArray[Any]:
    """The array of a sensor_msgs/Image, H x W or H x W x 3 in the order blue, green, red.

    Raises
    ------
    InputError
        If its encoding is not in `_READ_ENCODINGS`, or its size contradicts its header.
    """
    if body.encoding not in _READ_ENCODINGS:
        raise InputError(f"images are {body.encoding}; mono8, mono16, bgr8 or bgr16 is needed")
    code, channels = _READ_ENCODINGS[body.encoding]
    kind = np.dtype((">" if body.is_bigendian else "<") + code)
    used = body.width * channels * kind.itemsize
    if body.step < used or len(body.data) != body.step * body.height:
        raise InputError(f"an image of {body.width} x {body.height} holds {len(body.data)} bytes")
    rows = np.frombuffer(body.data, np.uint8).reshape(body.height, body.step)
    values = np.asarray(np.ascontiguousarray(rows[:, :used]).view(kind), kind.newbyteorder("="))
    if channels == 1:
        return values
    picture = values.reshape(body.height, body.width, channels)
    return picture[..., ::-1] if body.encoding.startswith("rgb") else picture


def cloud_message(topic: str, time: int, fields: Mapping[str, Any]) -> Message:
    """A sensor_msgs/PointCloud2 of float32 fields: N points on film, or H x W ordered points."""
    columns = np.broadcast_arrays(*fields.values())
    points = np.stack(columns, axis=-1).astype("<f4")
    width, step = points.shape[-2], 4 * len(fields)
    body = {
        "header": _header(time, FILM_FRAME),
        "height": len(points) if points.ndim > 2 else 1,
        "width": width,
        "fields": [
            {"name": name, "offset": 4 * i, "datatype": _FIELD_FLOAT32, "count": 1}
            for i, name in enumerate(fields)
        ],
        "is_bigendian": False,
        "point_step": step,
        "row_step": step * width,
        "data": points.tobytes(),
        "is_dense": bool(np.isfinite(points).all()),
    }
    return Message(topic, "sensor_msgs/msg/PointCloud2", time, body)


def pose_message(
    topic: str,
    time: int,
    position: NDArray[Any],
    quaternion: NDArray[Any],
    covariance: NDArray[Any],
) -> Message:
    """A geometry_msgs/PoseWithCovarianceStamped, in metres and radians; quaternion x, y, z, w."""
    pose = {
        "position": dict(zip("xyz", position.tolist(), strict=True)),
        "orientation": dict(zip("xyzw", quaternion.tolist(), strict=True)),
    }
    whole = {"pose": pose, "covariance": covariance.ravel().tolist()}
    body = {"header": _header(time, FILM_FRAME), "pose": whole}
    return Message(topic, "geometry_msgs/msg/PoseWithCovarianceStamped", time, body)


def diagnostics_message(time: int, warnings: list[str], values: Mapping[str, Any]) -> Message:
    """A diagnostic_msgs/DiagnosticArray with one status, of level warning if there are any."""
    status = {
        "level": 1 if warnings else 0,
        "name": "tactograph",
        "message": "; ".join(warnings) or "ok",
        "hardware_id": "",
        "values": [{"key": key, "value": str(value)} for key, value in values.items()],
    }
    body = {"header": _header(time, ""), "status": [status]}
    return Message("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", time, body)


def _header(time: int, frame: str) -> dict[str, Any]:
    seconds, rest = divmod(time, 1_000_000_000)
    return {"stamp": {"sec": seconds, "nanosec": rest}, "frame_id": frame}
