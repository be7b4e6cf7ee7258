"""A ROS 2 node: LED images in, height map out.

    python height_node.py --ros-args -p calibration:=cal.npz -p graph:=reconstruct

Subscribes to ``frames`` (sensor_msgs/Image, mono8 or mono16, ``header.frame_id`` "led1" to
"ledK") and publishes ``height`` (sensor_msgs/Image, 32FC1, metres) whenever a frame of every
LED is new.  The part that knows no ROS, `Touches`, is what the project's tests run.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import load

DTYPES = {"mono8": np.dtype(np.uint8), "8UC1": np.dtype(np.uint8), "mono16": np.dtype("<u2")}


class Touches:
    """Collects frames by LED until each of `leds` has a new one."""

    def __init__(self, leds: int) -> None:
        self.leds = leds
        self._frames: dict[int, NDArray[Any]] = {}

    def add(
        self, frame_id: str, encoding: str, size: tuple[int, int], step: int, data: bytes
    ) -> NDArray[Any] | None:
        """Take the fields of a sensor_msgs/Image; return K x H x W when all LEDs are there.

        Raises
        ------
        ValueError
            If the frame is none of an LED, or its pixels are not grey.
        """
        name, number = frame_id[:3], frame_id[3:]
        if name != "led" or not number.isdigit() or not 1 <= int(number) <= self.leds:
            raise ValueError(f"frame_id '{frame_id}': led1 to led{self.leds} are known")
        if encoding not in DTYPES:
            raise ValueError(f"encoding '{encoding}': {', '.join(DTYPES)} are known")
        dtype = DTYPES[encoding]
        rows = np.frombuffer(data, np.uint8).reshape(size[0], step)
        pixels = np.ascontiguousarray(rows[:, : size[1] * dtype.itemsize]).view(dtype)
        self._frames[int(number)] = pixels
        if len(self._frames) < self.leds:
            return None
        stack = np.stack([self._frames[k] for k in range(1, self.leds + 1)])
        self._frames.clear()
        return stack


def main() -> None:
    """Spin until ROS shuts down."""
    try:
        import rclpy
        from rclpy.node import Node
        from sensor_msgs.msg import Image
    except ImportError:
        sys.exit("ROS 2 (rclpy, sensor_msgs) is not here: source its setup file first")

    class Height(Node):  # type: ignore[misc]
        """The ROS side: parameters, topics, messages."""

        def __init__(self) -> None:
            super().__init__("tactograph")
            graph = self.declare_parameter("graph", "reconstruct").value
            calibration = self.declare_parameter("calibration", "cal.npz").value
            leds = self.declare_parameter("leds", 4).value
            self.pipeline = load(graph, calibration=calibration)
            self.touches = Touches(leds)
            self.publisher = self.create_publisher(Image, "height", 1)
            self.create_subscription(Image, "frames", self.take, 8)

        def take(self, message: Any) -> None:
            size = message.height, message.width
            try:
                stack = self.touches.add(
                    message.header.frame_id, message.encoding, size, message.step, message.data
                )
            except ValueError as error:
                self.get_logger().warning(str(error), throttle_duration_sec=1.0)
                return
            if stack is None:
                return
            height = self.pipeline(frames=stack)["height"].astype("<f4") / np.float32(1000)
            out = Image(height=height.shape[0], width=height.shape[1], encoding="32FC1")
            out.header.stamp, out.header.frame_id = message.header.stamp, "film"
            out.step, out.data = 4 * height.shape[1], height.tobytes()
            self.publisher.publish(out)

    rclpy.init()
    rclpy.spin(Height())


if __name__ == "__main__":
    main()
