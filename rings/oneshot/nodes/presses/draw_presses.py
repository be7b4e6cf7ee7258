"""Valid presses of a one-shot sensor, drawn by chance: what its calibration allows them to be."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from tactograph.rings.oneshot.nodes.file.read_press_calibration import read_press_calibration
from tactograph.sdk import Height, Light, Slope, node
from tactograph.sdk.unstable import Doubts

WIDTH_SHARES = (0.01, 0.3)
"""Distance over which errors of the light are alike, over the image's width, evenly drawn by its
logarithm: the calibration of a one-shot sensor states none."""
USUAL_CONTACT_MM = 0.05
"""Height above which film counts as touched."""


class DrawnPress(NamedTuple):
    """A press, the slopes that its light is that of, and the film at rest."""

    height: Height
    slope: Slope
    flat: Light


@node
def draw_presses(
    *,
    calibration: Path,
    count: Annotated[int, Interval(ge=1, le=100000)] = 128,
    seed: Annotated[int, Interval(ge=0)] = 0,
) -> Iterator[DrawnPress]:
    """Yield valid presses: balls, edges, folds, grooves, dents and none, shallow and steep.

    Parameters
    ----------
    calibration : the ``.npz`` of the sensor
    count : how many
    seed : the same presses for the same seed
    """
    sensor, rng = read_press_calibration(file=calibration), np.random.default_rng(seed)
    pixel, light = float(sensor.pixel_size), float(sensor.misfit[2])
    for number in range(count):
        width = pixel * sensor.flat.shape[2] * np.exp(rng.uniform(*np.log(WIDTH_SHARES)))
        doubts = Doubts(0.0, float(width), light, 0.0, USUAL_CONTACT_MM)
        yield DrawnPress(*doubts.touch(rng, number, sensor.flat, pixel))
