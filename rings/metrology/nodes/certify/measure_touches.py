"""The heights that a graph finds of captures, as one stack."""

from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from tactograph.rings.metrology.nodes.certify._sensor import certified_sensor
from tactograph.sdk import F4, Crop, InputError, PixelSize, Port, load, node

Heights = Annotated[F4, Port("N H W", "mm", low=-1, high=5, nan=True)]
"""The heights of N touches; NaN where they are not known."""


class Touches(NamedTuple):
    """Heights, their stated standard deviation, the truth beside the captures, and mm per px.

    All are None where there are no captures, and each where it is not known.
    """

    height: Heights | None = None
    error: Heights | None = None
    truth: Heights | None = None
    pixel: PixelSize | None = None


@node
def measure_touches(
    *,
    captures: Path | None = None,
    calibration: Path,
    graph: str = "",
    crop: Crop | None = None,
) -> Touches:
    """Measure every capture by the graph that users would, and keep the heights.

    Parameters
    ----------
    captures : folder of captures, in order of name, or one capture; None: there are none
    calibration : the calibration of the sensor
    graph
        Name of a graph that takes captures and this calibration; "": `precise`, or
        `gelsight_mini` for a one-shot sensor.
    crop : x0, y0, x1, y1 in pixels

    Raises
    ------
    InputError
        As the graph; if captures differ in size.
    """
    if captures is None:
        return Touches()
    params: dict[str, Any] = {"capture": str(captures), "calibration": str(calibration)}
    outputs = {"truth": "truth", "pixel": "cal.pixel_size"}
    chosen = graph or certified_sensor(calibration).graph
    graph_text = {"format": 1, "extends": [chosen], "outputs": outputs}
    with load(graph_text, params | ({"crop": crop} if crop else {})) as pipeline:
        touches = [result.outputs for result in pipeline.items()]
    heights = [touch["height"] for touch in touches]
    if len({height.shape for height in heights}) > 1:
        raise InputError(f"{captures}: holds captures of several sizes; certify each by itself")

    def stacked(name: str) -> F4 | None:
        arrays = [touch.get(name) for touch in touches]
        if all(each is None for each in arrays):
            return None
        nothing = np.full(heights[0].shape, np.nan, np.float32)
        return np.stack([nothing if each is None else each for each in arrays])

    return Touches(
        np.stack(heights), stacked("error"), stacked("truth"), float(touches[0]["pixel"])
    )
