"""Write everything that a reconstruction needs into one file."""

from typing import Unpack

from tactograph.graph import Provenance, node
from tactograph.nodes.calibrate.file.calibration import (
    CALIBRATION_KIND,
    Calibration,
    NewCalibration,
)
from tactograph.nodes.files.sensor_identity import SensorIdentity


@node
def write_calibration(
    *values: Unpack[Calibration],
    file: NewCalibration,
    sensor: str | None = None,
    provenance: Provenance,
) -> None:
    """Write the calibration as one ``.npz``, readable without pickle.

    Parameters
    ----------
    values
        The calibration.  Every graph that uses the file repeats its doubts.
    file : the file to write or replace
    sensor
        The sensor's name.  None: the name in the calibration that this one is derived from.  Images
        that name another sensor are refused.

    Raises
    ------
    InputError
        If no sensor can have this calibration, or if the file's name does not end in ``.npz`` or
        cannot be written.
    """
    sensor = sensor or SensorIdentity.behind(provenance).name or None
    about = {"sensor": sensor, "provenance": provenance}
    CALIBRATION_KIND.write_record(file, Calibration(*values), about)
