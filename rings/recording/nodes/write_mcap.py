"""Write touches as an MCAP file of ROS 2 messages, for Foxglove, Rerun and ``ros2 bag``."""

import json
from pathlib import Path
from typing import Annotated

from annotated_types import Ge

from tactograph.rings.recording.files.mcap_log import Limits, McapLog
from tactograph.rings.recording.nodes._touch_messages import touch_messages
from tactograph.sdk import Provenance, Session, Touch, node


@node
def write_mcap(
    touch: Touch,
    *,
    folder: Path,
    points_step: Annotated[int, Ge(0)] = 2,
    limits: Limits,
    provenance: Provenance,
    session: Session,
) -> None:
    """Write heights, images and diagnostics as ROS 2 messages into ``folder/*.mcap``.

    The topics of a touch: ``/height`` (sensor_msgs/Image 32FC1, in metres by ROS convention),
    ``/points`` (sensor_msgs/PointCloud2, metres), ``/led<k>/image`` (mono8), ``/diagnostics``
    (diagnostic_msgs: milliseconds per node, metrics, warnings) and ``/touch`` (std_msgs/String,
    its name).  Each layer adds those that its kind declares: images (``/shadow``, mono8, a bit per
    LED; ``/contact``, mono8, the contact's number), points (``/contacts``, PointCloud2, a point
    per contact with its figures, metres and radians; ``/markers``, a point per marker with its
    shift, metres), frames (``/pose``, geometry_msgs/PoseWithCovarianceStamped, the object's since
    the touch began, metres and radians).  All messages of a touch have the same stamp.

    Parameters
    ----------
    touch
        As `join_touch` makes it.  Without a time the stamp is the time of writing.
    folder
        Created if needed.  An existing export is continued in new files.
    points_step
        Spacing in px of the rows and columns of the height that become points; 0: no point
        cloud.

    Raises
    ------
    InputError
        If the folder cannot be written at first, or the ``mcap`` libraries are not installed.
    """
    about = {"format": "1", "graph": json.dumps(provenance.graph)}
    about |= {"inputs": json.dumps(provenance.inputs)}
    about |= {"view": json.dumps(touch.view.stated())}
    log = session.keep(lambda: McapLog(folder, about, limits))
    log.put(touch_messages(log.stamps.of(touch.time), touch, points_step, provenance))
