"""The calibration of a sensor whose LEDs flash: each of its values, declared once.

Reader and writer, their ports and pages, and the checks of a file follow from this record.  A new
value is a field here, or of `Film`.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator

from tactograph.graph import Port
from tactograph.nodes import (
    F4,
    Blur,
    Dark,
    Film,
    Height,
    LabelTurn,
    Lens,
    Light,
    LutLight,
    LutLit,
    LutSlope,
    Mask,
    Metrics,
    Misfit,
    Noise,
    NoiseCorrelation,
    NullVector,
    PixelSize,
    Reflectance,
    ScaleError,
    Spread,
)
from tactograph.nodes.files.calibration_file import FileKind
from tactograph.nodes.stored import Stored
from tactograph.nodes.trust.check_ranks import CheckRanks

MIN_LED_HEIGHT_MM = 1e-3
"""Smallest height of an LED."""
MIN_SINGULAR_VALUE = 1e-3
"""Smallest singular value of the directions to the LEDs; at 0 some slope changes no light."""

NO_MISFIT = (0, 1, 0, 0, 0)
"""The misfit of a model whose residual is pure noise."""


class Calibration(NamedTuple):
    """Everything that a reconstruction needs to know about a sensor."""

    flat: Annotated[Light, Stored(-0.05, 100), "the film at rest, fraction of full scale"]
    dark: Annotated[Dark, Stored(-1, 1), "with all LEDs off, fraction of full scale"]
    pixel_size: Annotated[PixelSize, "mm/px"]
    lut_light: Annotated[LutLight, Stored(-1e3, 1e3), "light of the tables, 1 on the film at rest"]
    lut_slope: Annotated[LutSlope, Stored(-1e4, 1e4), "slope of the tables, mm/mm"]
    lut_lit: Annotated[LutLit, Stored(), "bit k-1 is set where LED k reaches the pixel"]
    reflectance: Annotated[
        Reflectance,
        Stored(-1e4, 1e4),
        "nine harmonics per LED: 1 x y z xy xz yz xx-yy 3zz-1 of the unit normal",
    ]
    residual: Annotated[
        F4,
        Port("K", "1"),
        Stored(0, 1e3),
        "standard deviation of the reflectance fit's residual per LED",
    ]
    null: Annotated[NullVector, Stored(-1.001, 1.001), "unit vector a with a.I = 0"]
    spread: Annotated[Spread, Stored(0, 1e3), "standard deviation of a.I on lit pixels"]
    film: Film
    noise: Annotated[
        Noise, Stored(0, 1), "a captured light I has the variance noise[0] I + noise[1]"
    ]
    correlation: Annotated[
        NoiseCorrelation,
        Stored(1, 100, plain=1.0),
        "variance of a mean over pixels, relative to that with independent noise",
    ]
    lens: Annotated[
        Lens,
        Stored(-10, 10, plain=0.0),
        "k1 k2 cx cy a b gx gy: how the camera departs from an even grid",
    ]
    quality: Annotated[Metrics, "figures of the calibration's quality, for people"]
    doubts: Annotated[list[str], "doubts about the calibration, one sentence each"]
    area: Annotated[Mask, Stored(0, 1, plain=1), "1 where the frame shows film"]
    misfit: Annotated[
        Misfit,
        Stored(0, 1e6, plain=NO_MISFIT),
        "errors of the film's model on held-out presses: radians of a normal, mm over which it is "
        "correlated, light, share of the light from film to film, radians common to all normals",
    ] = np.asarray(NO_MISFIT, np.float32)
    serial: Annotated[str, "the camera's serial number, if it has one"] | None = None
    blur: Annotated[
        Blur,
        Stored(0, 100, plain=0.0),
        "px, standard deviation by which the camera spreads a point, beyond the pixel itself",
    ] = 0.0
    label_turn: Annotated[
        LabelTurn,
        Stored(0, 3.2, plain=0.0),
        "radians by which leaving out LEDs has to turn a normal; 0: any angle",
    ] = 0.0
    rest: (
        Annotated[
            Height,
            Stored(-1e3, 1e3, plain=0.0),
            "mm, height of the film at rest that each pixel sees; 0: a plane",
        ]
        | None
    ) = None
    scale_error: Annotated[
        ScaleError,
        Stored(0, 1e3, plain=0.0),
        "relative error of the heights' scale; 0: the light confirmed the radius",
    ] = 0.0
    ranks: CheckRanks | None = None


def _check_sensor(arrays: Mapping[str, NDArray[Any]]) -> None:
    """Refuse LEDs and tables whose light does not determine a slope."""
    for name in "lut_light", "lut_slope":
        if len(arrays[name]) > 1 and not np.ptp(arrays[name], axis=0).any():
            raise ValueError(f"'{name}' is the same for all entries")
    lights = arrays["lights"].astype(np.float64)
    if (lights[:, 2] < MIN_LED_HEIGHT_MM).any():
        raise ValueError("'lights' has an LED that is not above the film")
    away = lights / np.linalg.norm(lights, axis=1, keepdims=True)
    if np.linalg.svd(away, compute_uv=False)[-1] < MIN_SINGULAR_VALUE:
        raise ValueError("'lights' has all LEDs in one place or one line")


CALIBRATION_KIND = FileKind(
    "calibration",
    1,
    "run calibrate",
    Calibration,
    sources="the images, the pixel size, and the ball's place and radius",
    users="sensors whose LEDs flash: reconstruct, precise, paper",
    check=_check_sensor,
)
NewCalibration = Annotated[Path, AfterValidator(CALIBRATION_KIND.new_file)]
