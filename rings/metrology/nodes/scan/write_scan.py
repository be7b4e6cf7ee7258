"""Write a touch as a scan of GelSight's software: images, ``scan.yaml``, heights."""

import json
from pathlib import Path

import numpy as np

from tactograph.rings.export.formats import tmd
from tactograph.rings.metrology.nodes.scan.scan_file import (
    SCAN_FILE,
    MarkedBall,
    is_scan,
    read_scan,
)
from tactograph.sdk import (
    CaptureFile,
    Crop,
    Height,
    ImageFile,
    Light,
    PixelSize,
    atomic_files,
    node,
)

HEIGHT_FILE = "heightmap.tmd"


@node
def write_scan(
    image: Light,
    pixel: PixelSize,
    height: Height | None = None,
    name: str | None = None,
    *,
    folder: Path,
    model: str = "",
    marked: Path | None = None,
    crop: Crop | None = None,
) -> None:
    """Write ``image01.png`` ... and ``scan.yaml`` into `folder`, or its subfolder of the name.

    Parameters
    ----------
    image : K x H x W, fractions of full scale; 16 bit where 8 would lose something
    pixel : mm per px
    height : H x W in mm, written as ``heightmap.tmd``
    name : the capture's name in a stream; empty for a single capture
    folder : created if needed
    model
        File name of the sensor's light model, which the scan then names.  It is looked for in the
        scan's folder or the one above.
    marked, crop
        The captures' folder, and how the images were cropped.  Balls that are marked in a scan, or
        the ball of a ``capture.yaml``, become marks of the new one, with their radius.

    Raises
    ------
    InputError
        If the folder cannot be written, or film is unknown (NaN) in the height.
    """
    of_bytes = np.rint(255 * image)
    whole = bool(np.abs(of_bytes - 255 * image).max() < 1e-3)
    levels = of_bytes.astype(np.uint8) if whole else np.rint(65535 * image).astype(np.uint16)
    names = [f"image{k:02}.png" for k in range(1, len(image) + 1)]
    lines = ["images:", *(f"  - {each}" for each in names), f"mmperpixel: {pixel:.12g}"]
    lines += [f"calib: {json.dumps(Path(model).name)}", "crop: [0, 0, 0, 0]"]
    if marked is not None:
        lines += _marks(marked / (name or ""), pixel, crop)
    with atomic_files(folder / name if name else folder) as target:
        for each, plane in zip(names, levels, strict=True):
            ImageFile(target / each).write(plane)
        if height is not None:
            tmd.write(target / HEIGHT_FILE, height, pixel)
            lines.append(f"activeheightmap: {HEIGHT_FILE}")
        (target / SCAN_FILE).write_text("\n".join(lines) + "\n", encoding="utf-8")


def _marks(capture: Path, pixel: float, crop: Crop | None) -> list[str]:
    """Lines that mark the balls of a capture, balls as large as the balls."""
    x0, y0 = crop[:2] if crop else (0, 0)
    if is_scan(capture):
        scan = read_scan(capture)
        balls, radius = scan.balls, scan.ball_radius
    else:
        about = CaptureFile.read(capture)
        radius = about.ball_radius_mm or 0.0
        balls = ()
        if radius and about.ball_center_px:
            x, y = about.ball_center_px
            balls = (MarkedBall(0, 0, x, y, radius / pixel),)
    lines = [f"calibradius: {radius:.12g}"] if radius else []
    if balls:
        lines.append("annotations:")
    for mark in balls:
        place = f"gx: {mark.column}, gy: {mark.row}, x: {mark.x - x0:.12g}, y: {mark.y - y0:.12g}"
        lines.append(f"  - {{type: GridCircle, name: Circle, {place}, r: {mark.radius:.12g}}}")
    return lines
