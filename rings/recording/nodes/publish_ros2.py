"""Publish touches on ROS 2 topics."""

from typing import Annotated

from annotated_types import Ge

from tactograph.rings.recording.nodes._ros_node import RosNode
from tactograph.rings.recording.nodes._touch_messages import touch_messages
from tactograph.sdk import Provenance, Session, Touch, node


@node
def publish_ros2(
    touch: Touch,
    *,
    node_name: str = "tactograph",
    namespace: str = "tactograph",
    points_step: Annotated[int, Ge(0)] = 2,
    provenance: Provenance,
    session: Session,
) -> None:
    """Publish heights, layers of the touch and diagnostics on ROS 2 topics.

    The topics are those of `write_mcap`, below the namespace: ``tactograph/height`` and so on;
    ``/diagnostics`` stays where ROS expects it.  Topics without subscribers are not sent.  Needs
    a ROS 2 whose setup file is sourced.

    Parameters
    ----------
    touch : as for `write_mcap`
    points_step : step in px between rows and columns that become points, as for `write_mcap`
    node_name, namespace : the node's name in ROS, which must differ between sensors

    Raises
    ------
    InputError
        If ROS is not installed or rejects the name.
    """
    ros = session.keep(lambda: RosNode(node_name, namespace))
    stamp = ros.stamps.of(touch.time)
    ros.publish(touch_messages(stamp, touch, points_step, provenance))
