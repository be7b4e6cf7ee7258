"""Write everything a reconstruction needs into one file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np

from tactograph.graph import InputError, Port, Provenance, node
from tactograph.graph.whole import whole_file
from tactograph.nodes import (
    F4,
    Dark,
    Light,
    LightPositions,
    LutLight,
    LutLit,
    LutSlope,
    Metrics,
    Noise,
    NullVector,
    PixelSize,
    Reflectance,
    Spread,
)

FORMAT = 1
UNITS = {
    "flat": "fraction of full scale",
    "dark": "fraction of full scale",
    "pixel_size": "mm/px",
    "lut_light": "1 on the film at rest",
    "lut_slope": "mm/mm",
    "lut_lit": "bit k-1 is set where LED k reaches the pixel",
    "reflectance": "nine harmonics per LED: 1 x y z xy xz yz xx-yy 3zz-1 of the unit normal",
    "residual": "root mean square of the reflectance fit per LED",
    "null": "unit vector a with a.I = 0",
    "spread": "standard deviation of a.I on lit pixels",
    "lights": "mm, x y z per LED, from the middle of the image on the film at rest",
    "noise": "a captured light I has the variance noise[0] I + noise[1]",
}


@node
def write_calibration(
    flat: Light,
    dark: Dark,
    pixel: PixelSize,
    lut_light: LutLight,
    lut_slope: LutSlope,
    lut_lit: LutLit,
    reflectance: Reflectance,
    residual: Annotated[F4, Port("K", "1")],
    null: NullVector,
    spread: Spread,
    lights: LightPositions,
    noise: Noise,
    quality: Metrics,
    *,
    file: Path,
    provenance: Provenance,
) -> None:
    """Write the calibration as one ``.npz``, readable without pickle.

    Parameters
    ----------
    flat, dark
        K x H x W and H x W.
    pixel
        mm per px.
    lut_light, lut_slope, lut_lit
        The tables: N x K, N x 2, N.
    reflectance, residual
        K x 9 and K.
    null, spread
        Length K, and a number.
    lights, noise
        K x 3 in mm, and (shot, read).
    quality
        How good the calibration is, for people and for ``result.json``.
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
        "kind": "tactograph calibration",
        "units": UNITS,
        "quality": quality,
        "made": provenance.as_dict(),
    }
    with whole_file(file) as target:
        np.savez_compressed(
            target,
            about=np.array(json.dumps(about)),
            flat=flat,
            dark=dark,
            pixel_size=np.float32(pixel),
            lut_light=lut_light,
            lut_slope=lut_slope,
            lut_lit=lut_lit,
            reflectance=reflectance,
            residual=residual,
            null=null,
            spread=np.float32(spread),
            lights=lights,
            noise=noise,
        )
