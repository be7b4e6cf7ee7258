"""Read a calibration, and refuse an incomplete or damaged one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from tactograph.graph import EVERYTHING, Port, Wanted, node, warn
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
from tactograph.nodes.calibrate.file.write_calibration import CALIBRATION, NO_MISFIT
from tactograph.nodes.files.calibration_file import check_use, read_about, read_arrays
from tactograph.nodes.files.image_files import Lights
from tactograph.nodes.optics.film import matt_film


class Calibration(NamedTuple):
    """What `write_calibration` wrote."""

    flat: Light
    dark: Dark
    pixel_size: PixelSize
    lut_light: LutLight
    lut_slope: LutSlope
    lut_lit: LutLit
    reflectance: Reflectance
    residual: Annotated[F4, Port("K", "1")]
    null: NullVector
    spread: Spread
    noise: Noise
    correlation: NoiseCorrelation
    film: Film
    lens: Lens
    misfit: Misfit
    quality: Metrics
    doubts: list[str]


@node
def read_calibration(
    *, file: Path, lights: Lights | None = None, wanted: Wanted = EVERYTHING
) -> Calibration:
    """Read the ``.npz`` that `write_calibration` wrote, without pickle.

    A warning repeats what made the calibration doubtful.

    An old file that lacks the uncertainty of the LED positions is read as if they were exact,
    with a warning where that matters.

    Parameters
    ----------
    file
        The calibration.
    lights
        How the images that it is used for hold the lights, as for `read_capture`.  None: not
        known.

    Raises
    ------
    InputError
        If the file is missing, damaged, of another version or holds a pickle; if an array is
        missing, empty, misshapen, not finite or outside the range of any sensor; if an LED is
        not above the film, or no slope follows from the LEDs' light; if the calibration was made
        from lights of another order.
    """
    found = read_arrays(file, CALIBRATION)
    about = read_about(file)
    check_use(file, about, lights)
    if "others" not in found:
        found["others"] = np.repeat(found["lights"][None], 8, axis=0)
        if "others" in wanted:
            warn(
                f"{file}: does not say how exactly its LEDs are placed, which the stated errors "
                "leave out; calibrate again"
            )
    # Old files do not describe the film; they were made for a matt one.
    found.setdefault("lens", np.zeros(8, np.float32))
    found.setdefault("misfit", NO_MISFIT)
    found.setdefault("correlation", 1.0)
    film = {name: found.pop(name) for name in Film._fields if name in found}
    matt = matt_film(film["lights"])
    whole = matt._replace(**film)
    return Calibration(film=whole, **found, quality=about.quality, doubts=about.doubts)
