"""Find the pixels that look like the untouched film."""

import math
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Gt, Interval

from tactograph.graph import Close, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import Light, Mask, NoiseCorrelation
from tactograph.nodes.light.film_drift import FILM_ROUGHNESS


@node(tolerance=Close(share=1e-3, why="a threshold on a float32 mean"))
def calm_film(
    light: Light,
    sigma: Light | None = None,
    correlation: NoiseCorrelation | None = None,
    at_rest: Light | None = None,
    *,
    radius_px: Annotated[int, Interval(ge=0, le=8)] = 2,
    level: Annotated[float, Gt(0)] = 4.5,
) -> Mask:
    """Mark where the mean light of every LED is 1 within its noise.

    Light is divided by the flat frame, so it is 1 everywhere on the untouched film.  The mean
    over a window of w x w pixels has 1 / w of a pixel's noise (more if the noise of neighbours is
    correlated), so even the gentle skirt of a press differs from the film at rest.

    Parameters
    ----------
    light, sigma
        K x H x W; the standard deviation of each light.  None: it is not known, and a departure by
        `FILM_ROUGHNESS` counts as calm.
    correlation
        Correlation of the noise of neighbours, from `noise_correlation`; None: independent noise.
    at_rest : K x H x W, the light of the film at rest; None: 1, the light of a plane
    radius_px : the window is 2 radius_px + 1 wide; beyond the frame the border pixels repeat
    level : standard deviations of the mean that still count as noise

    Returns
    -------
    H x W, 1 where the film looks untouched.
    """
    width, level = 2 * radius_px + 1, _level(level, correlation, radius_px)
    calm = np.ones(light.shape[1:], bool)
    for k, plane in enumerate(light):
        still = np.float32(1) if at_rest is None else at_rest[k]
        departure = cv2.blur(plane - still, (width, width), borderType=cv2.BORDER_REPLICATE)
        most = width * FILM_ROUGHNESS if sigma is None else np.float32(level) * sigma[k]
        calm &= np.abs(departure) * np.float32(width) < most
    return calm.astype(np.uint8)


def _level(level: float, correlation: float | None, radius_px: int) -> float:
    """The threshold, raised for correlated noise; a window of one pixel needs no correction."""
    shared = ((correlation or 1.0) - 1) * (1 - 1 / (2 * radius_px + 1) ** 2)
    return level * math.sqrt(1 + shared)


@calm_film.opencl()
def _launch(run: Launch) -> None:
    count, rows, columns = (run.sizes[symbol] for symbol in "KHW")
    radius = run.settings["radius_px"]
    run.kernel(
        "calm_film", run.in_row_lanes(rows, columns),
        run.inputs["light"], run.inputs.get("sigma"), run.inputs.get("at_rest"),
        run.outputs["calm_film"], count, rows, columns,
        radius, _level(run.settings["level"], run.inputs.get("correlation"), radius),
        FILM_ROUGHNESS,
    )  # fmt: skip
