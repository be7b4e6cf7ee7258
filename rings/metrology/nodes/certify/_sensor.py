"""What the nodes of this room need of a calibration, whichever kind of sensor it is of."""

from pathlib import Path
from typing import NamedTuple

from tactograph.sdk import F4, FileKind, InputError, Light


class CertifiedSensor(NamedTuple):
    """The film at rest, mm per px, the lens, the camera's blur in px (None: not known)."""

    flat: Light
    pixel: float
    lens: F4
    blur: float | None
    graph: str
    """The most accurate graph for such a sensor."""
    ripples: str
    """The overlay that lays ripples on its film."""


def certified_sensor(calibration: Path) -> CertifiedSensor:
    """Read either kind of calibration.

    Raises
    ------
    InputError
        If it is none, or its film is no plane at rest.
    """
    sensor = FileKind.read_sensor(calibration)
    film = sensor.flat, float(sensor.pixel_size), sensor.lens
    if hasattr(sensor, "film"):
        if sensor.rest is not None and sensor.rest.any():
            raise InputError(
                f"{calibration}: its film is no plane at rest; balls, grids and ripples are "
                "compared on planes alone"
            )
        return CertifiedSensor(*film, float(sensor.blur), "precise", "drawn_ripples")
    return CertifiedSensor(*film, None, "gelsight_mini", "drawn_ripples_oneshot")
