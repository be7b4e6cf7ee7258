"""Publish touches on ROS 2 topics."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge

from tactograph.graph import Port, Provenance, Session, node
from tactograph.nodes import Contacts, Height, Labels, Light, Metrics, PixelSize
from tactograph.nodes.marker.find_markers import Markers
from tactograph.nodes.marker.track_markers import Seen, Shifts
from tactograph.nodes.recording._ros_node import RosNode
from tactograph.nodes.recording._touch_messages import TouchParts, TouchStamps, touch_messages


@node
def publish_ros2(
    height: Height,
    image: Light,
    pixel: PixelSize,
    name: str,
    shadow: Labels | None = None,
    metrics: Metrics | None = None,
    time: Annotated[float, Port(unit="s")] | None = None,
    contact: Contacts | None = None,
    markers: Markers | None = None,
    shift: Shifts | None = None,
    seen: Seen | None = None,
    *,
    node_name: str = "tactograph",
    namespace: str = "tactograph",
    points_step: Annotated[int, Ge(0)] = 2,
    provenance: Provenance,
    session: Session,
) -> None:
    """Publish heights, contacts, markers and diagnostics on ROS 2 topics.

    The topics are those of `write_mcap`, below the namespace: ``tactograph/height`` and so on;
    ``/diagnostics`` stays where ROS expects it.  Topics without subscribers are not sent.  Needs
    a ROS 2 whose setup file is sourced.

    Parameters
    ----------
    height, image, pixel, name, shadow, metrics, time, contact, markers, shift, seen, points_step
        As for `write_mcap`.
    node_name, namespace
        Its name in ROS, which must differ between sensors.

    Raises
    ------
    InputError
        If ROS is not installed or rejects the name.
    """
    sensor = session.keep(lambda: _Sensor(RosNode(node_name, namespace)))
    touch = TouchParts(height, image, pixel, name, shadow, contact, metrics, markers, shift, seen)
    sensor.ros.publish(touch_messages(sensor.stamps.of(time), touch, points_step, provenance))


class _Sensor:
    """The node, and the clock of its stamps."""

    def __init__(self, ros: RosNode) -> None:
        self.ros, self.stamps = ros, TouchStamps(follow=True)

    def close(self) -> None:
        self.ros.close()
