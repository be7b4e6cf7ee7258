"""The calibration of a sensor whose LEDs flash."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tactograph.nodes import F4
from tactograph.nodes.calibrate.file.calibration import CALIBRATION_KIND, Calibration
from tactograph.nodes.calibrate.file.read_calibration import read_calibration

KIND = CALIBRATION_KIND
LABELS_ACROSS = 15
"""LEDs share a label if they are closer than their distance from the film divided by this."""
LABEL_PLACE: dict[str, Any] = {"xytext": (-5, 4), "textcoords": "offset points", "ha": "right"}


def read(file: Path) -> Calibration:
    """Read the record: see `read_calibration`."""
    return read_calibration(file=file)


def draw(part: Any, arrays: Mapping[str, Any]) -> None:
    """Draw the LEDs, the alternative places within their error, and the film."""
    lights, others = arrays["lights"], arrays["other_lights"]
    width, height = arrays["pixel_size"] * np.array(arrays["flat"].shape[:0:-1])
    above, side = part.subplots(1, 2)
    _dots(above, lights[:, 0], lights[:, 1], others[..., 0], others[..., 1])
    box = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) * [width / 2, height / 2]
    above.plot(*box.T, color="black", label="film in the image")
    above.set(title="LEDs from above", xlabel="x / mm", ylabel="y / mm", aspect="equal")
    above.invert_yaxis()
    from_axis, others_from_axis = (
        np.hypot(each[..., 0], each[..., 1]) for each in (lights, others)
    )
    _dots(side, from_axis, lights[:, 2], others_from_axis, others[..., 2])
    side.plot([0, width / 2], [0, 0], color="black", label="film in the image")
    side.set(
        title="LEDs from the side", xlabel="from the axis / mm", ylabel="z / mm", aspect="equal"
    )
    side.legend(loc="center left", bbox_to_anchor=(1.05, 0.5))


def _dots(axes: Any, x: F4, y: F4, other_x: F4, other_y: F4) -> None:
    axes.plot(other_x.ravel(), other_y.ravel(), ".", color="#9a9a9a", label="as the fit allows")
    axes.plot(x, y, "o", color="#ffb000", label="LEDs")
    axes.margins(0.15)
    places = np.stack([x, y], axis=1)
    named: dict[int, list[str]] = {}
    for k, place in enumerate(places):
        near = np.abs(places[: k + 1] - place).max(axis=1) <= np.abs(places).max() / LABELS_ACROSS
        named.setdefault(int(near.argmax()), []).append(str(k + 1))
    for k, names in named.items():
        axes.annotate(", ".join(names), places[k], **LABEL_PLACE)
