"""Calibrations of one-shot sensors, which hold a reflectance map."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tactograph.rings.oneshot.nodes.file.press_calibration import (
    PRESS_CALIBRATION,
    PressCalibration,
)
from tactograph.rings.oneshot.nodes.file.read_press_calibration import read_press_calibration

KIND = PRESS_CALIBRATION
GRAPH, OVERLAY = "gelsight_mini", "drawn_presses"


def read(file: Path) -> PressCalibration:
    """Read the record: see `read_press_calibration`."""
    return read_press_calibration(file=file)


def draw(part: Any, arrays: Mapping[str, Any]) -> None:
    """Draw the change of each light with a slope in x and in y, in the middle of the film."""
    reflectance, places = arrays["reflectance"], np.arange(len(arrays["flat"]))
    axes = part.subplots(1, 1)
    for shift, (number, name) in enumerate(((0, "x"), (1, "y"))):
        axes.bar(
            places + 0.4 * shift, reflectance[:, number, 0], 0.4, label=f"normal towards {name}"
        )
    axes.set_xticks(places + 0.2, [f"light {k + 1}" for k in places])
    axes.set(title="change of light in the middle of the film, per unit of the normal")
    axes.legend()
