"""What the tests run under a real ROS 2, in its own Python: a peer that publishes and listens.

    python ros2_peer.py SITE_PACKAGES TASK ARGUMENTS...

It prints what it heard as JSON, a key for each topic.
"""

import json
import os
import site
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    for folder in sys.argv.pop(1).split(os.pathsep):
        site.addsitedir(folder)

import numpy as np

TIMEOUT_S = 30.0


class Peer:
    """A node of plain rclpy, in a thread of its own."""

    def __init__(self, topics: dict[str, str]) -> None:
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from rclpy.executors import SingleThreadedExecutor
        from sensor_msgs.msg import Image, PointCloud2
        from std_msgs.msg import String

        heard = (DiagnosticArray, Image, PointCloud2, PoseWithCovarianceStamped, String)
        kinds = {each.__name__: each for each in heard}
        self.heard: dict[str, Any] = {}
        self.moments: dict[tuple[int, int], dict[str, Any]] = {}
        self.topics = set(topics)
        self._context = rclpy.Context()
        self._context.init()
        self.node = rclpy.create_node("peer", context=self._context)
        for topic, kind in topics.items():
            self.node.create_subscription(kinds[kind], topic, self._hears(topic), 4)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._executor.spin)
        self._thread.start()
        self._end = time.monotonic() + TIMEOUT_S

    def _hears(self, topic: str) -> Callable[[Any], None]:
        def hear(message: Any) -> None:
            self.heard[topic] = message
            if hasattr(message, "header"):
                stamp = message.header.stamp
                self.moments.setdefault((stamp.sec, stamp.nanosec), {})[topic] = message

        return hear

    @property
    def waits(self) -> bool:
        """Whether something is still to be heard."""
        return self.topics != set(self.heard) and self.in_time

    @property
    def in_time(self) -> bool:
        """Whether it is worth waiting on."""
        return time.monotonic() < self._end

    def close(self) -> dict[str, Any]:
        """Leave ROS; what was heard, as plain data."""
        self._executor.shutdown()
        self._thread.join()
        self.node.destroy_node()
        self._context.try_shutdown()
        return {topic: plain(message) for topic, message in self.heard.items()}


def plain(message: Any) -> Any:
    """A message of ROS as plain data."""
    if hasattr(message, "get_fields_and_field_types"):
        fields = message.get_fields_and_field_types()
        return {name: plain(getattr(message, name)) for name in fields}
    if hasattr(message, "tobytes"):
        return message.tobytes().hex()
    if isinstance(message, bytes):
        return int.from_bytes(message)
    return [plain(each) for each in message] if isinstance(message, list) else message


def publish(touch_file: str) -> dict[str, Any]:
    """Publish the touch of a file of arrays by the node, until every topic was heard."""
    from tactograph.graph import Provenance, Session
    from tactograph.nodes.stream.touch import Touch
    from tactograph.rings.mechanics.layers.markers import MarkerTracks
    from tactograph.rings.mechanics.layers.pose import ObjectPose
    from tactograph.rings.recording.nodes.publish_ros2 import publish_ros2

    kinds = {"height": "Image", "contact": "Image", "points": "PointCloud2", "touch": "String"}
    kinds |= {"contacts": "PointCloud2", "markers": "PointCloud2", "shadow": "Image"}
    kinds |= {"pose": "PoseWithCovarianceStamped"}
    peer = Peer({f"/pad/{name}": kind for name, kind in kinds.items()} | DIAGNOSTICS)
    parts = dict(np.load(touch_file))
    figures = json.loads(str(parts.pop("metrics")))
    tracks = MarkerTracks(*(parts.pop(name) for name in MarkerTracks._fields))
    pose = ObjectPose(*(parts.pop(name) for name in ObjectPose._fields))
    height, image = parts.pop("height"), parts.pop("image")
    made = Provenance({"name": "toy"}, None, [], {}, {}, ["too bright"], [])
    session = Session()
    while peer.waits:
        touch = Touch(
            height, image, 0.05, "000007", time.monotonic(), metrics=figures,
            layers={**parts, "markers": tracks, "pose": pose},
        )  # fmt: skip
        publish_ros2(touch, namespace="pad", provenance=made, session=session)
        time.sleep(0.05)
    session.close()
    return peer.close()


def graph(calibration: str, capture: str) -> dict[str, Any]:
    """Publish a capture's frames, and let the graph `ros2` answer with its height."""
    import cv2
    from sensor_msgs.msg import Image

    from tactograph.graph.run.open_pipeline import open_pipeline

    peer = Peer({"/tactograph/height": "Image", "/tactograph/contacts": "PointCloud2"})
    publisher = peer.node.create_publisher(Image, "/tactograph/frames", 10)
    heard = threading.Event()

    def flash() -> None:
        # As long as the graph asks: without frames it would wait, and not see that all is heard.
        while peer.in_time and not heard.is_set():
            for file in sorted(Path(capture).glob("led*.png")):
                grey = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
                message = Image(height=grey.shape[0], width=grey.shape[1], encoding="mono8")
                message.header.stamp.sec, message.header.frame_id = 1_700_000_000, file.stem
                message.step, message.data = grey.shape[1], grey.tobytes()
                publisher.publish(message)
                time.sleep(0.03)

    camera = threading.Thread(target=flash)
    camera.start()
    arguments = {"calibration": calibration, "seconds": TIMEOUT_S}
    with open_pipeline("ros2", arguments, backend="numpy") as pipeline:
        for _ in pipeline.items():
            if not peer.waits:
                break
    heard.set()
    camera.join()
    return peer.close()


def listen(topics: str, frame: str) -> dict[str, Any]:
    """Hear topics until something touches the film; publish a colour image meanwhile, if any.

    What has a stamp is that of one touch: on a busy machine the latest message of one topic may be
    a second later than that of another.
    """
    from sensor_msgs.msg import Image

    kinds = json.loads(topics)
    peer = Peer(kinds)
    publisher = peer.node.create_publisher(Image, "/pad/frames", 4)
    stamped = {topic for topic, kind in kinds.items() if kind != "String"}
    (contacts,) = (topic for topic in stamped if topic.endswith("contacts"))
    touch: dict[str, Any] | None = None
    while peer.waits or (peer.in_time and touch is None):
        whole = (each for each in list(peer.moments.values()) if set(each) == stamped)
        touch = next((each for each in whole if each[contacts].width), None)
        if frame:
            colours = np.load(frame)
            message = Image(height=colours.shape[0], width=colours.shape[1], encoding="bgr8")
            message.header.stamp = peer.node.get_clock().now().to_msg()
            message.step, message.data = colours[0].nbytes, colours.tobytes()
            publisher.publish(message)
        time.sleep(0.03)
    return peer.close() | {topic: plain(message) for topic, message in (touch or {}).items()}


def command(*words: str) -> dict[str, Any]:
    """What a user types, in a Python that has ROS."""
    from tactograph.graph.command import main

    sys.argv = ["tactograph", *words]
    main()
    return {}


def refuse(_: str) -> dict[str, Any]:
    """What the node says of a name that ROS refuses."""
    from tactograph.graph import InputError
    from tactograph.rings.recording.nodes._ros_node import RosNode

    try:
        RosNode("not a name", "")
    except InputError as error:
        return {"refused": str(error)}
    return {}


DIAGNOSTICS = {"/diagnostics": "DiagnosticArray"}

if __name__ == "__main__":
    tasks = {"publish": publish, "graph": graph, "refuse": refuse}
    tasks |= {"listen": listen, "command": command}
    print(json.dumps(tasks[sys.argv[1]](*sys.argv[2:])))
