"""Write everything that a reconstruction needs into one file."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator

from tactograph.graph import Port, Provenance, node
from tactograph.nodes import (
    F4,
    Dark,
    Film,
    Lens,
    Light,
    LutLight,
    LutLit,
    LutSlope,
    Metrics,
    Misfit,
    Noise,
    NoiseCorrelation,
    NullVector,
    PixelSize,
    Reflectance,
    Spread,
)
from tactograph.nodes.files.calibration_file import FileKind, Stored, free_for, write_arrays

NEAREST = 1e-3
"""Height in mm of the lowest LED that a sensor can have."""
APART = 1e-3
"""Smallest singular value of the directions to the LEDs; at 0 some slope changes no light."""


def _check_lights(arrays: Mapping[str, NDArray[Any]]) -> None:
    """Refuse LEDs from whose light no slope follows."""
    lights = arrays["lights"].astype(np.float64)
    if (lights[:, 2] < NEAREST).any():
        raise ValueError("'lights' holds an LED that is not above the film")
    away = lights / np.linalg.norm(lights, axis=1, keepdims=True)
    if np.linalg.svd(away, compute_uv=False)[-1] < APART:
        raise ValueError("'lights' holds LEDs that are all in one place or one line")


CALIBRATION = FileKind(
    "calibration",
    1,
    "run calibrate",
    {
        "flat": Stored("K H W", "fraction of full scale", low=-1, high=100),
        "dark": Stored("H W", "fraction of full scale", low=-1, high=1),
        "pixel_size": Stored("", "mm/px", low=1e-6, high=1e3),
        "lut_light": Stored("N K", "1 on the film at rest", low=-1e3, high=1e3),
        "lut_slope": Stored("N 2", "mm/mm", low=-1e4, high=1e4),
        "lut_lit": Stored("N", "bit k-1 is set where LED k reaches the pixel", np.uint8),
        "reflectance": Stored(
            "K 9",
            "nine harmonics per LED: 1 x y z xy xz yz xx-yy 3zz-1 of the unit normal",
            low=-1e4,
            high=1e4,
        ),
        "residual": Stored("K", "root mean square of the reflectance fit per LED", low=0, high=1e3),
        "null": Stored("K", "unit vector a with a.I = 0", low=-1.001, high=1.001),
        "spread": Stored("", "standard deviation of a.I on lit pixels", low=0, high=1e3),
        "lights": Stored(
            "K 3",
            "mm, x y z per LED, from the middle of the image on the film at rest",
            low=-1e8,
            high=1e8,
        ),
        "noise": Stored(
            "2", "a captured light I has the variance noise[0] I + noise[1]", low=0, high=1
        ),
        "correlation": Stored(
            "",
            "a mean over pixels has so many times the variance that independent noise leaves",
            required=False,
            low=1,
            high=100,
        ),
        "others": Stored(
            "8 K 3",
            "mm, other places of the LEDs that the fit allows",
            required=False,
            low=-1e8,
            high=1e8,
        ),
        "diffuse": Stored(
            "K", "share of an LED's light that the gel diffuses", required=False, low=0, high=0.99
        ),
        "harmonics": Stored(
            "K 8 6",
            "harmonics x y z-1 xy xz yz xx-yy 3(zz-1) of the unit normal, by 1 u v uu uv vv",
            required=False,
            low=-100,
            high=100,
        ),
        "flattest": Stored("", "smallest n_z that was pressed", required=False, low=0, high=1),
        "reach": Stored("", "mm, the unit of u and v", required=False, low=1e-06, high=1000000.0),
        "gain": Stored(
            "", "light of touched film relative to untouched film", required=False, low=0.1, high=10
        ),
        "contact": Stored(
            "",
            "mm, height from which film counts as touched",
            required=False,
            low=1e-09,
            high=1000.0,
        ),
        "base": Stored(
            "", "albedo of the base under the coat", required=False, low=0.001, high=1000.0
        ),
        "roughness": Stored("", "Beckmann's alpha of the coat", required=False, low=0.01, high=10),
        "refraction": Stored(
            "", "refractive index of the coat; 1: none", required=False, low=1, high=10
        ),
        "albedo": Stored(
            "", "share of light that the film throws back", required=False, low=0, high=0.95
        ),
        "rim": Stored("", "mm of film beyond the frame", required=False, low=0, high=1000.0),
        "camera": Stored(
            "", "1/mm, one over the pupil's height; 0: far", required=False, low=0, high=10
        ),
        "grain": Stored(
            "",
            "light departs by this share, beyond the camera's noise",
            required=False,
            low=0,
            high=1,
        ),
        "uneven": Stored(
            "",
            "brightness of touched film departs by this share, under all LEDs alike",
            required=False,
            low=0,
            high=1,
        ),
        "misfit": Stored(
            "5",
            "what the film's model leaves on presses held out: radians of a normal, over how many "
            "mm alike, light, the share of bounced light that may be wrong, radians of all tilts",
            required=False,
            low=0,
            high=1e6,
        ),
        "lens": Stored(
            "8",
            "k1 k2 cx cy a b gx gy: how the camera departs from an even grid",
            required=False,
            low=-10,
            high=10,
        ),
    },
    made_from="the images, and the ball's place and radius",
    check=_check_lights,
)

NO_MISFIT = np.array([0, 1, 0, 0, 0], np.float32)
"""The misfit of a model that leaves only noise."""
NewCalibration = Annotated[Path, AfterValidator(partial(free_for, kind=CALIBRATION))]


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
    film: Film,
    noise: Noise,
    lens: Lens,
    quality: Metrics,
    misfit: Misfit | None = None,
    correlation: NoiseCorrelation | None = None,
    doubts: list[str] | None = None,
    *,
    file: NewCalibration,
    sensor: str | None = None,
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
    film
        The LEDs, the film and the camera.
    noise
        (shot, read).
    lens
        Length 8, as `read_lens` returns it.
    quality
        Figures of the calibration's quality, for people and for ``result.json``.
    misfit
        Errors of the film's model on held-out presses.  None: the model is exact.
    correlation
        Noise correlation of the pixels.  None: their noise is independent.
    doubts
        What speaks against the calibration, a sentence each: every graph that uses the file
        repeats it.
    file
        The file; it is replaced as a whole.
    sensor
        The sensor's name, for people.

    Raises
    ------
    InputError
        If the calibration cannot be of a sensor, the file's name does not end in ``.npz``, or it
        cannot be written.
    """
    arrays = {
        "flat": flat,
        "dark": dark,
        "pixel_size": pixel,
        "lut_light": lut_light,
        "lut_slope": lut_slope,
        "lut_lit": lut_lit,
        "reflectance": reflectance,
        "residual": residual,
        "null": null,
        "spread": spread,
        **film._asdict(),
        "noise": noise,
        "correlation": 1.0 if correlation is None else correlation,
        "lens": lens,
        "misfit": NO_MISFIT if misfit is None else misfit,
    }
    about = {"quality": quality, "doubts": doubts or [], "sensor": sensor, "made": provenance}
    write_arrays(file, CALIBRATION, arrays, about)
