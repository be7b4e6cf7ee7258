"""List the connected cameras."""

import os
import sys

import cv2
from rich.console import Console
from rich.table import Column, Table

from tactograph.rings.live.nodes.camera._camera_names import named_cameras
from tactograph.rings.live.nodes.camera._genicam_camera import (
    PRODUCER_VARIABLE,
    GenicamCapture,
    genicam_cameras,
)
from tactograph.rings.live.nodes.camera._linux_camera import linuxpy
from tactograph.sdk import InputError, node


@node
def list_cameras() -> None:
    """Print device, name and serial number of every camera, its formats, sizes and rates.

    ``camera=serial:...`` selects a camera regardless of its port.  Formats, sizes and rates need
    linuxpy (``pip install 'tactograph[linux]'``).  Industrial cameras, as ``genicam:...``, need
    harvesters (``pip install 'tactograph[genicam]'``) and their maker's GenTL producer in
    GENICAM_GENTL64_PATH.

    Raises
    ------
    InputError
        If the system is not Linux, the only one that lists cameras this way, and no industrial
        camera is found.
    """
    industrial = genicam_cameras() if os.environ.get(PRODUCER_VARIABLE) else []
    if sys.platform != "linux" and not industrial:
        raise InputError("cameras are listed on Linux only; elsewhere try the indices 0, 1, ...")
    cameras = [*named_cameras(), *industrial]
    titles = "device", "name", "serial", "formats, sizes and frames per second"
    table = Table(*(Column(title, overflow="fold") for title in titles), box=None, pad_edge=False)
    hint = "" if cameras else "no camera is plugged in, or the kernel knows none"
    for camera in cameras:
        try:
            formats = (_pixel_formats if camera in industrial else _formats)(camera.device)
        except InputError as error:
            formats, hint = "", f"formats are not listed: {error}"
        table.add_row(camera.device, camera.name, camera.serial or "-", formats)
    if cameras:
        Console(width=None if sys.stdout.isatty() else 120).print(table)
    if hint:
        print(hint)


def _formats(device: str) -> str:
    """One line per pixel format: sizes, and the fastest rate of each."""
    video = linuxpy()
    sizes: dict[str, dict[str, None]] = {}
    try:
        with video.Device(device) as opened:
            for kind in opened.info.frame_types:
                size = f"{kind.width}x{kind.height}@{float(kind.max_fps):g}"
                sizes.setdefault(kind.pixel_format.name, {})[size] = None
    except OSError as error:
        return f"cannot be opened: {error.strerror or error}"
    return "\n".join(f"{name}: {' '.join(each)}" for name, each in sizes.items())


def _pixel_formats(device: str) -> str:
    """The pixel formats of a GenICam camera, and the size that it is set to."""
    capture = GenicamCapture(device, colour=False)
    try:
        if not capture.isOpened():
            return f"cannot be opened: {capture.reason}"
        width, height = (
            capture.get(prop) for prop in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
        )
        return f"{' '.join(capture.formats)}: {width:g}x{height:g}"
    finally:
        capture.release()
