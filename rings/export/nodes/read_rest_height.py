"""Read the film at rest above which a stored height is."""

from pathlib import Path

from tactograph.sdk import Height, StoredResult, node, warn
from tactograph.sdk.nodes import distort_height, read_calibration


@node
def read_rest_height(*, height: Path, calibration: Path | None = None) -> Height | None:
    """Return the height of the film at rest that each pixel of the camera sees, as calibrated.

    A warning repeats what made the calibration doubtful.

    Parameters
    ----------
    height : the file of a height above that film
    calibration : the sensor's

    Returns
    -------
    H x W in mm; None for a plane, or, with a warning, for a result whose film is none.

    Raises
    ------
    InputError
        If the calibration cannot be read.
    """
    if calibration is None:
        if StoredResult.beside(height).has_relief:
            warn(
                f"{height}: its film is no plane at rest; meshes lay the height out on a plane "
                "without the sensor's `calibration`"
            )
        return None
    sensor = read_calibration(file=calibration)
    return None if sensor.rest is None else distort_height(sensor.rest, sensor.lens)
