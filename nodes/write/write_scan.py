"""Write a touch as a scan of GelSight's software: images, ``scan.yaml``, heights."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tactograph.graph import InputError, node
from tactograph.graph.disk.atomic_files import atomic_files
from tactograph.nodes import Height, Light, PixelSize
from tactograph.nodes.files.gelsight_scan import SCAN_FILE
from tactograph.nodes.files.height_files import write_tmd
from tactograph.nodes.files.image_files import write_image

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
) -> None:
    """Write ``image01.png`` ... and ``scan.yaml`` into `folder`, or its subfolder of the name.

    Parameters
    ----------
    image
        K x H x W, fractions of full scale; 16 bit where 8 would lose something.
    pixel
        mm per px.
    height
        H x W in mm, written as ``heightmap.tmd``.
    name
        The capture's name in a stream; empty for a single capture.
    folder
        Created if needed.
    model
        File name of the sensor's light model, which the scan then names.  It is looked for in the
        scan's folder or the one above.

    Raises
    ------
    InputError
        If the folder cannot be written, or the height has another size or unknown film.
    """
    if height is not None and height.shape != image.shape[1:]:
        raise InputError(
            f"the height is {height.shape[1]} x {height.shape[0]} px, the images "
            f"{image.shape[2]} x {image.shape[1]}"
        )
    of_bytes = np.rint(255 * image)
    whole = bool(np.abs(of_bytes - 255 * image).max() < 1e-3)
    levels = of_bytes.astype(np.uint8) if whole else np.rint(65535 * image).astype(np.uint16)
    names = [f"image{k:02}.png" for k in range(1, len(image) + 1)]
    lines = ["images:", *(f"  - {each}" for each in names), f"mmperpixel: {pixel:.12g}"]
    lines += [f"calib: {Path(model).name or chr(34) * 2}", "crop: [0, 0, 0, 0]"]
    with atomic_files(folder / name if name else folder) as target:
        for each, plane in zip(names, levels, strict=True):
            write_image(target / each, plane)
        if height is not None:
            write_tmd(target / HEIGHT_FILE, height, pixel)
            lines.append(f"activeheightmap: {HEIGHT_FILE}")
        (target / SCAN_FILE).write_text("\n".join(lines) + "\n", encoding="utf-8")
