"""Write touches as an MCAP file of ROS 2 messages, for Foxglove, Rerun and ``ros2 bag``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Gt

from tactograph.graph import Port, Provenance, Session, node
from tactograph.nodes import Contacts, Height, Labels, Light, Metrics, PixelSize
from tactograph.nodes.files.mcap_log import Limits, McapLog, WhenFull
from tactograph.nodes.marker.find_markers import Markers
from tactograph.nodes.marker.track_markers import Seen, Shifts
from tactograph.nodes.recording._touch_messages import TouchParts, TouchStamps, touch_messages


@node
def write_mcap(
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
    folder: Path,
    points_step: Annotated[int, Ge(0)] = 2,
    file_mb: Annotated[float, Gt(0)] = 512.0,
    total_gb: Annotated[float, Gt(0)] = 50.0,
    when_full: WhenFull = "stop",
    wait: bool = False,
    provenance: Provenance,
    session: Session,
) -> None:
    """Write heights, images and diagnostics as ROS 2 messages into ``folder/*.mcap``.

    The topics of a touch: ``/height`` (sensor_msgs/Image 32FC1, in metres by ROS convention),
    ``/points`` (sensor_msgs/PointCloud2, metres), ``/shadow`` (mono8, a bit per LED),
    ``/contact`` (mono8, the contact's number), ``/contacts`` (PointCloud2, a point per contact
    with its figures, metres and radians), ``/markers`` (PointCloud2, a point per marker with its
    shift, metres), ``/led<k>/image`` (mono8), ``/diagnostics`` (diagnostic_msgs: milliseconds
    per node, metrics, warnings) and ``/touch`` (std_msgs/String, its name).  All messages of a
    touch have the same stamp.

    Parameters
    ----------
    height
        H x W in mm.
    image
        K x H x W, 0 to 1.
    pixel
        mm per px.
    name
        The touch's name.
    shadow
        H x W, the LEDs that do not reach each pixel.
    metrics
        Figures for the diagnostics; those of `measure_contact` also make up ``/contacts``.
    time
        When the newest frame was exposed, in seconds of ``time.monotonic()``; without it the
        stamp is the time of writing.
    contact
        H x W, the number of the contact at each pixel.
    markers, shift, seen
        M x 3 and M x 2 in px, and M, as `find_markers` and `track_markers` return them.
    folder
        Created if needed.  An existing export is continued in new files.
    points_step
        Spacing in px of the rows and columns of the height that become points; 0: no point
        cloud.
    file_mb
        Size at which a new file begins.
    total_gb
        Largest total size of all files in the folder.
    when_full
        At that limit, "stop" writing or delete the "oldest" file.
    wait
        Let the stream wait for a slow disk instead of leaving touches out; for streams that are
        not live.

    Raises
    ------
    InputError
        If the folder cannot be written at first, or the ``mcap`` libraries are not installed.
    """
    limits = Limits(
        file_bytes=1e6 * file_mb,
        file_s=float("inf"),
        total_bytes=1e9 * total_gb,
        when_full=when_full,
        wait=wait,
    )
    about = {"format": "1", "graph": json.dumps(provenance.graph)}
    export = session.keep(lambda: _Export(McapLog(folder, about, limits)))
    touch = TouchParts(height, image, pixel, name, shadow, contact, metrics, markers, shift, seen)
    export.log.put(touch_messages(export.stamps.of(time), touch, points_step, provenance))
    export.log.tell()


class _Export:
    """The log, and the clock of its stamps."""

    def __init__(self, log: McapLog) -> None:
        self.log, self.stamps = log, TouchStamps()

    def close(self) -> None:
        self.log.close()
