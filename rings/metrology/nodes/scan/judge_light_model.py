"""Judge whether a light model is this sensor's, by the residual light and the film's brightness."""

import numpy as np

from tactograph.rings.metrology.nodes.scan.light_model import LightModel
from tactograph.rings.metrology.nodes.scan.light_model_slope import ModelSlope, light_model_slope
from tactograph.sdk import InputError, Light, Odds, Slope, node, warn
from tactograph.sdk.nodes import slope_curl

MAX_RESIDUAL = 0.01
"""Share of a cell's light that a model leaves at half of the cells; 0.005 on scans of two sensors
by their own models; 0.011 to 0.075 by others' models, by LEDs in another order, with one dimmed."""
REFUSED_RESIDUAL = 0.02
"""Share that refuses a model alone; a smaller one does where the brightness is wrong as well."""
MAX_BRIGHTNESS_RATIO = 1.33
"""Ratio of the film's brightness to that when the model was made, or its inverse, at most."""
TRIED_RESIDUAL = 0.006
"""Share above which other orders of the LEDs are tried; a mirror image of them leaves 0.0076."""


@node
def judge_light_model(
    fit: ModelSlope,
    light: Light | None = None,
    model: LightModel | None = None,
    *,
    only_warn: bool = False,
) -> dict[str, float]:
    """Warn where the light contradicts the model, and refuse a model that is clearly another's.

    Parameters
    ----------
    fit : of cells, whose noise is small
    light, model
        K x H x W of the same cells: then other orders of the LEDs, turned or reversed, are tried:
        slopes by a wrong one are those of no surface.
    only_warn : warn at most

    Returns
    -------
    dict
        ``model_residual``, the median of the residual, as a share of the light's brightness, and
        ``model_brightness``, that of the brightness.

    Raises
    ------
    InputError
        If the residual is above `REFUSED_RESIDUAL`, or above `MAX_RESIDUAL` at a brightness out of
        its range, or if the LEDs in another order explain the light, unless `only_warn`.
    """
    bright = float(np.median(fit.brightness))
    residual = _unexplained(fit)
    doubts: list[str] = []
    if light is not None and model is not None and residual > TRIED_RESIDUAL:
        doubts += _of_order(light, model)
    usual, is_sure = 1 / MAX_BRIGHTNESS_RATIO < bright < MAX_BRIGHTNESS_RATIO, bool(doubts)
    if residual > MAX_RESIDUAL:
        is_sure |= residual > REFUSED_RESIDUAL or not usual
        doubts.append(
            f"the light model leaves {residual:.1%} of the light unexplained at half of the "
            "surface: is it this sensor's, and are the images in the order of its LEDs?"
        )
    elif not usual:
        doubts.append(
            f"the film is {bright:.2g} times as bright as when the light model was made: is it "
            "this sensor's, with the same exposure?"
        )
    if is_sure and not only_warn:
        raise InputError(f"{doubts[0]} `only_warn`=true continues anyway")
    for doubt in doubts:
        warn(doubt)
    return {"model_residual": residual, "model_brightness": bright}


def _unexplained(fit: ModelSlope) -> float:
    return float(np.median(fit.residual)) / max(float(np.median(fit.brightness)), 1e-6)


def _of_order(light: Light, model: LightModel) -> list[str]:
    """A doubt of images whose order is turned or reversed, if another is likelier by sure `Odds`.

    What an order leaves of the light, times the curl of its slopes, counts as a deviation.
    """
    ring = np.arange(len(light))
    orders = [np.roll(each, by) for each in (ring, ring[::-1]) for by in ring]
    slopes_by_order = (light_model_slope(light[each], model) for each in orders)
    misfits = [(_unexplained(fit), _curl(fit.slope)) for fit in slopes_by_order]
    product = np.prod(misfits, axis=1)
    best = int(np.argmin(product))
    odds = Odds.of_frame(product[0], product[best], 0, len(light))
    if not odds.are_sure or misfits[best][0] >= MAX_RESIDUAL:
        return []
    order = ", ".join(str(led + 1) for led in orders[best])
    return [f"the images fit the light model in the order {order} of those listed: sort them."]


def _curl(slope: Slope) -> float:
    """The curl of slopes, over that of the cells of a surface and added to it, on average."""
    squared = slope_curl(slope, np.zeros(5, np.float32))
    return float(np.sqrt(1 + np.maximum(squared, 0)).mean())
