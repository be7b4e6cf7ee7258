"""Scans of GelSight's software as captures: ``scan.yaml`` lists the images."""

from pathlib import Path

from tactograph.rings.metrology.nodes.scan.scan_file import read_scan
from tactograph.sdk import ListedCapture


def read(folder: Path) -> ListedCapture:
    """Read images, pixel size and marked balls of a scan.

    Raises
    ------
    InputError
        As `read_scan`.
    """
    scan = read_scan(folder)
    circles = tuple((ball.x, ball.y, ball.radius) for ball in scan.balls)
    return ListedCapture(scan.images, scan.pixel_size, circles, scan.ball_radius)
