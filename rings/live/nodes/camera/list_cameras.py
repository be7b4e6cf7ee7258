"""List the connected cameras."""

import os
import sys

from rich.console import Console
from rich.table import Table

from tactograph.rings.live.nodes.camera._camera_names import named_cameras
from tactograph.rings.live.nodes.camera._genicam_camera import PRODUCER_VARIABLE, genicam_cameras
from tactograph.sdk import InputError, node


@node
def list_cameras() -> None:
    """Print device, name and serial number of every camera.

    ``camera=serial:...`` selects a camera regardless of its port.  Industrial cameras, as
    ``genicam:...``, need harvesters (``pip install 'tactograph[genicam]'``) and their maker's GenTL
    producer in GENICAM_GENTL64_PATH.

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
    table = Table("device", "name", "serial", box=None, pad_edge=False)
    for camera in cameras:
        table.add_row(camera.device, camera.name, camera.serial or "-")
    if cameras:
        Console(width=None if sys.stdout.isatty() else 120).print(table)
    else:
        print("no camera is plugged in, or the kernel knows none")
