"""What the nodes of this room need of a calibration, whichever kind of sensor it is of."""

from pathlib import Path
from typing import NamedTuple

from tactograph.sdk import F4, Light
from tactograph.sdk.nodes import read_calibration, read_press_calibration
from tactograph.sdk.unstable import PRESS_CALIBRATION, is_of_kind


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
        If it is none.
    """
    if is_of_kind(calibration, PRESS_CALIBRATION):
        known = read_press_calibration(file=calibration)
        blur, graph, overlay = None, "gelsight_mini", "drawn_ripples_oneshot"
    else:
        known = read_calibration(file=calibration)
        blur, graph, overlay = float(known.blur), "precise", "drawn_ripples"
    return CertifiedSensor(known.flat, float(known.pixel_size), known.lens, blur, graph, overlay)
