"""Write the calibration of a one-shot sensor into one file."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator

from tactograph.graph import Provenance, node, warn
from tactograph.nodes import Light, Metrics, PixelSize
from tactograph.nodes.files.calibration_file import FileKind, Stored, free_for, write_arrays
from tactograph.nodes.optics.reflectance_map import SHADES, TERMS
from tactograph.nodes.slope.solve_reflectance_map import ReflectanceMap

PRESS_CALIBRATION = FileKind(
    "press calibration",
    1,
    "run calibrate_presses",
    {
        "flat": Stored("K H W", "fraction of full scale", low=-1, high=100),
        "pixel_size": Stored("", "mm/px", low=1e-6, high=1e3),
        "reflectance": Stored(
            f"K {SHADES} {TERMS}",
            "light less 1 (the film at rest) per x, y, z - 1, xy, xz, yz, xx - yy, 3zz - 3 of the "
            "unit normal and per mm of height; times 1, u, v, uu, uv, vv, ... to degree 4, u and v "
            "being x and y in px from the image's middle divided by half its width",
            low=-1e6,
            high=1e6,
        ),
    },
    made_from="the images, and the ball's place and radius",
)
NewPressCalibration = Annotated[Path, AfterValidator(partial(free_for, kind=PRESS_CALIBRATION))]


@node
def write_press_calibration(
    flat: Light,
    pixel: PixelSize,
    reflectance: ReflectanceMap,
    quality: Metrics,
    advice: str,
    doubts: list[str] | None = None,
    *,
    file: NewPressCalibration,
    sensor: str | None = None,
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
        From `rate_presses`.  The file stores them, and a warning repeats advice to press more.
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
    write_arrays(
        file,
        PRESS_CALIBRATION,
        {"flat": flat, "pixel_size": pixel, "reflectance": reflectance},
        {
            "quality": quality,
            "advice": advice,
            "doubts": doubts or [],
            "sensor": sensor,
            "made": provenance,
        },
    )
    if advice.startswith("press"):
        warn(advice)
