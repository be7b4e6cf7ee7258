"""Write the calibration of a one-shot sensor into one file."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from tactograph.graph import InputError, Provenance, node, warn
from tactograph.graph.whole import whole_file
from tactograph.nodes import Light, Metrics, PixelSize
from tactograph.nodes.solve_reflectance_map import ReflectanceMap

KIND = "tactograph press calibration"
FORMAT = 1
UNITS = {
    "flat": "fraction of full scale",
    "pixel_size": "mm/px",
    "reflectance": (
        "light less 1 (the film at rest) per x, y, z - 1, xy, xz, yz, xx - yy, 3zz - 3 of the unit "
        "normal and per mm of height; times 1, u, v, uu, uv, vv, ... to degree 4, u and v being "
        "x and y in px from the image's middle divided by half its width"
    ),
}


@node
def write_press_calibration(
    flat: Light,
    pixel: PixelSize,
    reflectance: ReflectanceMap,
    quality: Metrics,
    advice: str,
    *,
    file: Path,
    provenance: Provenance,
) -> None:
    """Write flat, pixel size and reflectance map as one ``.npz``, readable without pickle.

    Parameters
    ----------
    flat
        K x H x W, the film at rest.
    pixel
        mm per px.
    reflectance
        K x 9 x 15.
    quality, advice
        As `rate_presses` gives them; kept in the file, the advice told too.
    file
        Where to; replaced as a whole.

    Raises
    ------
    InputError
        If the file is not called ``.npz`` or cannot be written.
    """
    if file.suffix != ".npz":
        raise InputError(f"out={file}: a calibration file is called something.npz")
    about = {
        "format": FORMAT,
        "kind": KIND,
        "units": UNITS,
        "quality": quality,
        "advice": advice,
        "made": provenance.as_dict(),
    }
    with whole_file(file) as target:
        np.savez_compressed(
            target,
            about=np.array(json.dumps(about)),
            flat=flat,
            pixel_size=np.float32(pixel),
            reflectance=reflectance,
        )
    if advice.startswith("press"):
        warn(advice)
