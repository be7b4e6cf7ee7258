"""The number of the contact at each pixel, and the contacts' figures as points of a stream."""

from collections.abc import Mapping

import numpy as np

from tactograph.nodes import F8, METRES_PER_MM, Contacts
from tactograph.nodes.stream.touch import LabelMap, LayerKind, Touch


def _points(touch: Touch, contact: Contacts) -> Mapping[str, F8] | None:
    """Return one point per contact, from number 1: its centroid, with its depth as z."""
    figures = touch.metrics or {}
    if "contacts" not in figures:
        return None
    measured = [int(key.rpartition("/c")[2]) for key in figures if key.startswith("contact_x_px/")]
    numbers = range(1, max(measured, default=0) + 1)

    def each(name: str, unit: float) -> F8:
        # A contact number without pixels has no figures.
        return unit * np.array([figures.get(f"contact_{name}/c{n}", np.nan) for n in numbers])

    rows, columns = touch.height.shape
    side = touch.pixel * METRES_PER_MM
    return {
        "x": each("x_mm", METRES_PER_MM) + side * (columns - 1) / 2,
        "y": each("y_mm", METRES_PER_MM) + side * (rows - 1) / 2,
        "z": each("depth_mm", METRES_PER_MM),
        "mean_depth": each("mean_depth_mm", METRES_PER_MM),
        "area": each("area_mm2", METRES_PER_MM**2),
        "volume": each("volume_mm3", METRES_PER_MM**3),
        "major": each("major_mm", METRES_PER_MM),
        "minor": each("minor_mm", METRES_PER_MM),
        "angle": each("angle_deg", np.pi / 180),
        "cut": each("cut", 1),
    }


KIND = LayerKind(Contacts, LabelMap("contacts"), topics={"contact": None, "contacts": _points})
