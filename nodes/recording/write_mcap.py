"""Write touches as an MCAP file of ROS 2 messages, for Foxglove, Rerun and ``ros2 bag``."""

from __future__ import annotations

import json
import time as clock
from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt

from tactograph.graph import Port, Provenance, Session, node, warn
from tactograph.nodes import Height, Labels, Light, Metrics, PixelSize
from tactograph.nodes.recording._mcap_log import Limits, McapLog, WhenFull
from tactograph.nodes.recording._ros import (
    MM,
    Message,
    cloud_message,
    diagnostics_message,
    image_message,
    text_message,
)

FRAME = "film"
"""ROS's name of the coordinate system: x right, y down, z towards the camera."""
FULL_SCALE = 255


@node
def write_mcap(
    height: Height,
    image: Light,
    pixel: PixelSize,
    name: str,
    shadow: Labels | None = None,
    metrics: Metrics | None = None,
    time: Annotated[float, Port(unit="s")] | None = None,
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
    """Write heights, images and diagnostics as messages of ROS 2 into ``folder/*.mcap``.

    The topics of a touch: ``/height`` (sensor_msgs/Image 32FC1, metres, as ROS wants it),
    ``/points`` (sensor_msgs/PointCloud2, metres), ``/shadow`` (mono8, a
    bit per LED), ``/led<k>/image`` (mono8), ``/diagnostics`` (diagnostic_msgs: milliseconds per
    node, metrics, warnings) and ``/touch`` (std_msgs/String, its name).  All of a touch bear the
    same stamp.

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
        H x W, the shadowed LEDs.
    metrics
        Figures for the diagnostics.
    time
        When the newest frame was exposed, in seconds of ``time.monotonic()``; without it the
        stamp is the time of writing.
    folder
        Made if needed.  What is there already is continued in new files.
    points_step
        Every such row and column of the height becomes points; 0: no point cloud.
    file_mb
        A new file is begun when one is as large.
    total_gb
        What all files in the folder may take together.
    when_full
        At that limit "stop" writing, or let the "oldest" file go.
    wait
        Let the stream wait for a slow disk, instead of leaving touches out: for streams that
        are not live.

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
    stamp = export.stamp(time)
    times = {f"{step['node']} / ms": step["ms"] for step in provenance.nodes}
    figures = {**times, **(metrics or {})}
    export.log.put(
        [
            *(
                image_message(f"/led{k}/image", stamp, _eight_bit(plane), f"led{k}")
                for k, plane in enumerate(image, start=1)
            ),
            image_message("/height", stamp, height * np.float32(MM), FRAME),
            *([image_message("/shadow", stamp, shadow, FRAME)] if shadow is not None else []),
            *_cloud(stamp, height, pixel, points_step),
            diagnostics_message("/diagnostics", stamp, "tactograph", provenance.warnings, figures),
            text_message("/touch", stamp, name),
        ]
    )
    for line in export.log.take_lines():
        warn(line)


class _Export:
    """The log, and what turns the camera's clock into the time of day."""

    def __init__(self, log: McapLog) -> None:
        self.log = log
        self._offset = clock.time_ns() - clock.monotonic_ns()

    def stamp(self, time: float | None) -> int:
        return clock.time_ns() if time is None else round(1e9 * time) + self._offset

    def close(self) -> None:
        self.log.close()


def _cloud(stamp: int, height: Height, pixel: float, step: int) -> list[Message]:
    if not step:
        return []
    return [cloud_message("/points", stamp, height[::step, ::step], step * pixel, FRAME)]


def _eight_bit(plane: Light) -> Labels:
    scaled = np.clip(np.rint(plane * np.float32(FULL_SCALE)), 0, FULL_SCALE)
    return np.asarray(scaled, np.uint8)
