"""Rippled film as a calibrated sensor sees it, measured by the graph that users run."""

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval

from tactograph.rings.metrology.nodes.certify._sensor import certified_sensor
from tactograph.rings.metrology.nodes.certify.measure_touches import Touches
from tactograph.sdk import load, node


@node
def see_ripples(
    *,
    calibration: Path,
    graph: str = "",
    count: Annotated[int, Interval(ge=0, le=100)] = 2,
    seed: Annotated[int, Interval(ge=0)] = 0,
) -> Touches:
    """Render rippled film by the calibration's own model, and find its height.

    Where no surface with fine structure is at hand, this says what calibration, camera and graph
    let through, with the blur that `calibrate` found.  How film follows an object is not in it.

    Parameters
    ----------
    calibration : of the sensor
    graph : as for `measure_touches`
    count : how many films; 0: none, so that there is no transfer function
    seed : the same films and noise for the same seed
    """
    if not count:
        return Touches()
    sensor = certified_sensor(calibration)
    params: dict[str, Any] = {"calibration": str(calibration), "count": count, "seed": seed}
    params["blur_px"] = sensor.blur or 0.0
    graph_text = {"format": 1, "extends": [graph or sensor.graph, sensor.ripples]}
    with load(graph_text, params, outputs=["height", "truth"]) as pipeline:
        touches = [result.outputs for result in pipeline.items()]
    height, truth = (np.stack([each[name] for each in touches]) for name in ("height", "truth"))
    return Touches(height, None, truth, sensor.pixel)
