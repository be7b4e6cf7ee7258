"""Write a simulated capture with its ground truth."""

import json
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval

from tactograph.graph import node
from tactograph.graph.disk.atomic_files import atomic_files
from tactograph.nodes import Height, Labels, Light, LightPositions, PixelSize, Slope
from tactograph.nodes.files.image_files import ImageFile, Lights


@node
def write_capture(
    image: Light,
    height: Height,
    slope: Slope,
    pixel: PixelSize,
    labels: Labels | None = None,
    lights: LightPositions | None = None,
    *,
    folder: Path,
    order: Lights = "leds",
    bits: Annotated[int, Interval(ge=1, le=16)] = 8,
) -> None:
    """Write ``led1.png`` ... as a camera would, and the ground truth of a reconstruction.

    Parameters
    ----------
    image : K x H x W, fractions of full scale, already quantised to `bits`
    height, slope, labels
        The ground truth: ``truth_height_mm.npy``, ``truth_slope.npy``, ``truth_shadow.png``
        (bit k-1 set where LED k does not reach the pixel), if it is known.  The height is the
        film's own, also where the film at rest is no plane.
    lights, pixel : the LED positions in mm, if they are known, and the pixel size: ``scene.json``
    folder : created if needed
    order : "bgr" or "rgb" if the lights are the channels of one picture, ``touch.png``
    bits : bit depth of the images; up to 8 give 8-bit files, more give 16-bit ones

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    dtype, full = (np.uint8, 255) if bits <= 8 else (np.uint16, 65535)
    with atomic_files(folder) as target:
        counts = np.rint(image * full).astype(dtype)
        if order == "leds":
            for k, plane in enumerate(counts, start=1):
                ImageFile(target / f"led{k}.png").write(plane)
        else:
            colours = counts if order == "bgr" else counts[::-1]
            ImageFile(target / "touch.png").write(np.ascontiguousarray(np.moveaxis(colours, 0, -1)))
        np.save(target / "truth_height_mm.npy", height)
        np.save(target / "truth_slope.npy", slope)
        scene: dict[str, Any] = {"pixel_size_mm": pixel}
        if labels is not None:
            ImageFile(target / "truth_shadow.png").write(labels)
        if lights is not None:
            scene["lights_mm"] = lights.astype(float).tolist()
        (target / "scene.json").write_text(json.dumps(scene, indent=1) + "\n")
