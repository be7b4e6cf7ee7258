"""How true places along x and y are, by a grid on the film at rest."""

from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Gt

from tactograph.rings.metrology.nodes.certify._sensor import certified_sensor
from tactograph.sdk import Crop, InputError, View, node
from tactograph.sdk.nodes import find_grid, read_grey


@node
def xy_mapping(
    *,
    calibration: Path,
    grid: Path | None = None,
    pitch_mm: Annotated[float, Gt(0)] | None = None,
    crop: Crop | None = None,
) -> dict[str, float]:
    """Compare the places of a grid's marks, by the calibration's lens and pixel, with its pitch.

    Rotation and position of the grid are free.  ISO 25178-600: the amplification coefficients
    of x and y are the factors by which lengths come out too long, the x-y mapping deviation is
    what is left of places after one factor for both.

    Parameters
    ----------
    calibration : of the sensor
    grid : an image of dots or a checkerboard, other than `calibrate_camera` had; None: none
    pitch_mm : distance between neighbouring marks
    crop : x0, y0, x1, y1 in pixels

    Returns
    -------
    dict
        ``xy_amplification_coefficient``, ``xy_mapping_deviation_um``, the largest, and
        ``xy_mapping_rms_um``; ``grid_marks``.

    Raises
    ------
    InputError
        As `find_grid`; if pitch and grid are not given together.
    """
    if (grid is None) != (pitch_mm is None):
        raise InputError("a grid needs both: `grid`=IMAGE `pitch_mm`=DISTANCE")
    if grid is None or pitch_mm is None:
        return {}
    sensor = certified_sensor(calibration)
    image = read_grey(file=grid, crop=crop)
    size = image.shape
    if size != sensor.flat.shape[1:]:
        raise InputError(f"{grid}: is not as large as the calibration's images")
    marks = find_grid(image)
    x, y = View(sensor.lens).ideal(size, *marks.place.T)
    measured = sensor.pixel * (x + 1j * y)
    true = pitch_mm * (marks.cell @ [1, 1j])
    measured, true = measured - measured.mean(), true - true.mean()
    turn = np.vdot(true, measured) / np.vdot(true, true).real
    mirrored = np.vdot(true.conj(), measured) / np.vdot(true, true).real
    if abs(mirrored) > abs(turn):
        turn, true = mirrored, true.conj()
    residual = 1e3 * np.abs(measured - turn * true)
    return {
        "xy_amplification_coefficient": float(abs(turn)),
        "xy_mapping_deviation_um": float(residual.max()),
        "xy_mapping_rms_um": float(np.sqrt(np.mean(np.square(residual)))),
        "grid_marks": float(len(true)),
    }
