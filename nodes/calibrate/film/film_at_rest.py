"""The flat frame in the fit of a film: residuals, their derivatives and standard deviation."""

import numpy as np

from tactograph.nodes import F8
from tactograph.nodes.calibrate.ball.balls_on_film import Fitted
from tactograph.nodes.calibrate.film.film_unknowns import UNKNOWNS_OF_TOUCH_ALONE, Unknowns
from tactograph.nodes.calibrate.lights.light_fit import LIGHT_DEVIATION
from tactograph.nodes.calibrate.lights.light_samples import Rest
from tactograph.nodes.optics.coat import MIN_COSINE
from tactograph.nodes.optics.film import rest_light
from tactograph.nodes.optics.rest_shape import MIN_REST_LIGHT, rest_share

MAX_INDEPENDENT_REST = 20
"""Most independent values per LED that the flat frame counts as where it departs from the model,
because its departures are smooth."""


def rest_residual(rest: Rest, now: Fitted) -> F8:
    """Logarithm of the flat frame minus the model's, without the LEDs' common part: K x M."""
    model = _rest_model(rest, now)
    return np.asarray(rest.logarithm - (model - model.mean(axis=0)))


def _rest_model(rest: Rest, now: Fitted) -> F8:
    """Logarithm of the light of the film at rest: K x M."""
    model = np.log(rest_light(now.film, rest.x, rest.y)) + now.leds[:, 3:4]
    if rest.beneath is not None:
        n, *place = rest.beneath
        light = rest_share(now.film, n, *place)
        if rest.bounced is not None:
            light = light + now.film.albedo * rest.bounced
        model += np.log(np.maximum(light, MIN_REST_LIGHT))
    # Cosines of emission from LEDs that face the middle of the film.
    lx, ly, lz = now.film.lights.T[..., None].astype(np.float64)
    high = np.sqrt(lx * lx + ly * ly + lz * lz)
    away = np.sqrt((lx - rest.x) ** 2 + (ly - rest.y) ** 2 + lz * lz)
    cosine = (high * high - lx * rest.x - ly * rest.y) / (high * away)
    model += now.leds[:, 4:] * np.log(np.maximum(cosine, MIN_COSINE))
    return np.asarray(model if now.power == 1 else model * now.power)


def by_rest(rest: Rest, now: Fitted, unknowns: Unknowns) -> F8:
    """Derivatives of `rest_residual` by the unknowns: U x K x M."""
    without = () if rest.beneath else UNKNOWNS_OF_TOUCH_ALONE
    model = _rest_model(rest, now)
    by = unknowns.differences(now, without, model, lambda _, other: _rest_model(rest, other))
    return np.asarray(by.mean(axis=1, keepdims=True) - by)


def rest_spread(rough: F8, rest: Rest) -> float:
    """Standard deviation of a block; larger if the flat frame (smoothly) departs from the model."""
    noise = LIGHT_DEVIATION / rest.block
    residual = float(np.sqrt(np.square(rough).mean()))
    if rest.beneath is not None:
        # The light of a film of known shape measures the LEDs: a model that leaves more is wrong.
        residual = min(residual, LIGHT_DEVIATION)
    return float(np.hypot(noise, residual * np.sqrt(max(1, rough.shape[1] / MAX_INDEPENDENT_REST))))
