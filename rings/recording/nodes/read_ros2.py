"""Read touches from a ROS 2 topic on which a camera driver publishes images."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Gt, Interval
from numpy.typing import NDArray

from tactograph.rings.frames.calibrated_film import CalibratedFilm, calibrated_film
from tactograph.rings.frames.colour_planes import Order, planes_of
from tactograph.rings.frames.live_frames import LiveFrames
from tactograph.rings.frames.rest_film import full_scale, top_of
from tactograph.rings.recording.files.ros_messages import read_image
from tactograph.rings.recording.files.stamps import day_offset_ns
from tactograph.rings.recording.nodes._ros_node import RosNode
from tactograph.sdk import InputError, Light, LiveState, node, warn

WAIT_S = 0.1
IMAGE_TYPE = "sensor_msgs/msg/Image"


@node(endless=True)
def read_ros2(
    *,
    calibration: Path,
    topic: str = "frames",
    node_name: str = "tactograph_frames",
    namespace: str = "tactograph",
    lights: Order = "bgr",
    bits: Annotated[int, Interval(ge=8, le=16)] | None = None,
    seconds: Annotated[float, Gt(0)] | None = None,
    items: Annotated[int, Ge(1)] | None = None,
) -> Iterator[LiveFrames]:
    """Yield a touch whenever every LED has a new image.

    Images are sensor_msgs/Image, ``mono8`` or ``mono16``, and ``header.frame_id`` names the lit
    LED: ``led1`` to ``ledK``.  With a one-shot sensor every image (``bgr8``, ``rgb8``, or 16
    bits) is a touch.  Other images are left out with a warning.  Needs a ROS 2 whose setup file
    is sourced.

    Parameters
    ----------
    calibration
        The sensor's calibration; it gives the number of LEDs and whether it is a one-shot
        sensor.
    topic : topic of the images, below the namespace unless it begins with a slash
    node_name, namespace : the node's name in ROS, which must differ between sensors
    lights : for a one-shot sensor: the calibration's order of the colours
    bits : bit depth, if the camera uses fewer bits than its 16-bit images hold
    seconds, items : time, or number of touches, after which to end; None: never

    Returns
    -------
    Touches as `read_camera` yields them, but `new` is empty and no faults are counted.  `time`
    is the image's stamp, converted to the clock of ``time.monotonic()``.

    Raises
    ------
    InputError
        If ROS is not installed or rejects a name, or the calibration cannot be read.
    """
    film = calibrated_film(calibration)
    touches = RosTouches(film, lights, bits)
    ros = RosNode(node_name, namespace)
    try:
        messages = ros.subscribe(topic, IMAGE_TYPE)
        end = None if seconds is None else time.monotonic() + seconds
        while (end is None or time.monotonic() < end) and touches.state.touches != items:
            if not messages:
                ros.wait(WAIT_S)
                continue
            touch = touches.take(messages.popleft())
            if touch is not None:
                yield touch
    finally:
        ros.close()


@read_ros2.rehearsal
def _rehearsal(*, calibration: Path, **_: Any) -> LiveFrames:
    """The film at rest, from the calibration."""
    return calibrated_film(calibration).touch


class RosTouches:
    """Makes touches from images; of ROS it only uses the fields of its images.

    Parameters
    ----------
    film : gives the number of LEDs, the image size, and whether all LEDs are lit at once
    lights, bits : as for `read_ros2`

    Attributes
    ----------
    state : the counters
    """

    def __init__(self, film: CalibratedFilm, lights: Order, bits: int | None) -> None:
        self._film, self._lights, self._full = film, lights, full_scale(bits)
        self._offset = day_offset_ns()
        self._new: dict[int, NDArray[Any]] = {}
        self.state = LiveState()

    def take(self, image: Any) -> LiveFrames | None:
        """Take a sensor_msgs/Image; return the touch if this completes it."""
        self.state.frames += 1
        try:
            light = self._light(image)
        except InputError as error:
            warn(f"an image of ROS 2 is left out: {error}")
            return None
        if light is None:
            return None
        stamp = image.header.stamp
        moment = 1e-9 * (10**9 * stamp.sec + stamp.nanosec - self._offset)
        return LiveFrames.counted(light, moment, [], self.state)

    def _light(self, image: Any) -> Light | None:
        """The light of all LEDs, once each has a new image."""
        data = read_image(image)
        leds, rows, columns = self._film.flat.shape
        if data.shape[:2] != (rows, columns):
            raise InputError(
                f"it has {data.shape[1]} x {data.shape[0]} pixels, but the calibration is for "
                f"{columns} x {rows}"
            )
        if data.dtype.kind != "u":
            raise InputError(f"it is {image.encoding}, but a camera's are of 8 or 16 bits")
        full = top_of(data, self._full)
        if self._film.one_shot:
            if data.ndim < 3:
                raise InputError(f"it is {image.encoding}, but a one-shot sensor's is in colour")
            return planes_of(data, self._lights, full)
        if data.ndim > 2:
            raise InputError(f"it is {image.encoding}, but that of one LED is mono8 or mono16")
        name = image.header.frame_id
        led = int(name[3:]) if name[:3] == "led" and name[3:].isdecimal() else 0
        if not 1 <= led <= leds:
            raise InputError(f"frame_id '{name}': led1 to led{leds} are known")
        self._new[led] = data / np.float32(full)
        if len(self._new) < leds:
            return None
        light = np.stack([self._new[k] for k in range(1, leds + 1)])
        self._new.clear()
        return light
