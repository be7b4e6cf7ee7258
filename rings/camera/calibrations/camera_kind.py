"""Lenses of cameras."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from tactograph.sdk import View
from tactograph.sdk.unstable import CAMERA_KIND

KIND = CAMERA_KIND
MARKS_ACROSS = 12
"""Places across the image at which a lens's displacement is drawn."""


def draw(figure: Any, arrays: Mapping[str, Any]) -> None:
    """Draw the displacements at which the camera sees places of an even grid."""
    columns, rows = (int(side) for side in arrays["size"])
    figure.set_size_inches(8, 8 * rows / columns + 1)
    axes = figure.subplots()
    step = max(columns // MARKS_ACROSS, 1)
    half = View.unit((rows, columns))
    y, x = np.mgrid[:rows:step, :columns:step]
    u, v = (x - (columns - 1) / 2) / half, (y - (rows - 1) / 2) / half
    du, dv = View(arrays["lens"]).offset(u, v)
    places = [x + half * du, y + half * dv]
    axes.plot(x.ravel(), y.ravel(), ".", color="#9a9a9a", label="even grid")
    axes.plot(
        *(plane.ravel() for plane in places), "+", color="#ffb000", label="as the camera sees it"
    )
    axes.set(xlabel="x / px", ylabel="y / px", aspect="equal")
    axes.invert_yaxis()
    axes.legend()
