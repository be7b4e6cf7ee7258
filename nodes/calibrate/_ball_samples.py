"""Samples of balls pressed into a film: what a film's model is fitted to."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, U1, Film
from tactograph.nodes.calibrate._film_fit import FAINT, Balls
from tactograph.nodes.calibrate.level_touches import DEGREE, ROUGH
from tactograph.nodes.capture._sheet import cut
from tactograph.nodes.light._near_light import F8, places
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.light.film_bounce import film_bounce
from tactograph.nodes.light.film_drift import drift_gain, film_drift
from tactograph.nodes.light.light_noise import light_noise

INNER = 0.95
"""Share of a contact's radius that is fitted: the film leaves the ball before the rim."""
SAMPLES, ENOUGH = 1500, 30
"""Samples of all balls together, and of each ball at least."""
USUAL_ALBEDO = 0.6
"""Of a film that a bounce is computed for."""
NOISY = 1.5
"""Times the camera's noise, up to which a departure is no more than that."""
SLICES = 16
"""Of a ball; every fourth is held out where there is no other ball."""


def sample_balls(
    light: F4,
    flat: F4,
    circle: F4,
    radius: F4,
    of: NDArray[np.int32],
    film: Film,
    noise: F4,
    pixel: float,
    steepest: float,
    most: int | None = SAMPLES,
    bare: U1 | None = None,
) -> Balls:
    """Choose samples of the balls, evenly over each.

    Parameters
    ----------
    light
        K x S x W, the presses relative to the film at rest, on a sheet (`_sheet`).
    flat
        K x H x W, the film at rest.
    circle, radius, of
        B x 3 in px, B in mm, and the press that each ball is in.
    film
        With LEDs and a coat that throw light from film to film.
    noise, pixel
        (shot, read), mm per px.
    steepest
        Steeper samples are left out.
    most
        Of all balls together, though `ENOUGH` of each; None: all pixels.
    bare
        S x W, 0 on pixels that are left out; None: there are none.
    """
    rows, columns = flat.shape[1:]
    x, y = places(columns, np.float32(pixel)), places(rows, np.float32(pixel))
    each = None if most is None else max(ENOUGH, most // len(circle))
    presses = cut(light, rows)
    sigma = coarsen(light_noise(flat, flat, noise))
    thrown = {
        i: _unit_bounce(presses[i], sigma, circle[of == i], radius[of == i], film, pixel)
        for i in np.unique(of)
    }
    found: list[tuple[NDArray[Any], ...]] = []
    for number, i in enumerate(of):
        u0, v0, rim = circle[number].astype(np.float64)
        reach = min(INNER * rim, radius[number] / pixel * np.sin(np.arctan(steepest)))
        yy, xx = np.mgrid[
            max(0, int(v0 - reach)) : min(rows, int(v0 + reach) + 2),
            max(0, int(u0 - reach)) : min(columns, int(u0 + reach) + 2),
        ].reshape(2, -1)
        within = np.hypot(xx - u0, yy - v0) < reach
        if bare is not None:
            within &= bare[i * rows + yy, xx] > 0
        inside = np.flatnonzero(within)
        # A stride that is no divisor of rows spreads the samples over all columns.
        inside = inside[:: 1 if each is None else inside.size // each + 1]
        yy, xx = yy[inside], xx[inside]
        sector = np.floor(np.arctan2(yy - v0, xx - u0) / (2 * np.pi) % 1 * SLICES).astype(int)
        values, bounced = presses[i][:, yy, xx], thrown[i][:, yy, xx]
        found.append((x[xx], y[yy], values, bounced, np.full(xx.size, number), sector))
    u, v, values, bounced, ball, sector = (
        np.concatenate(part, axis=-1) for part in zip(*found, strict=True)
    )
    middle = np.array([(columns - 1) / 2, (rows - 1) / 2])
    return Balls(
        u=u.astype(np.float64),
        v=v.astype(np.float64),
        light=values.astype(np.float64),
        ball=ball,
        centre=(circle[:, :2].astype(np.float64) - middle) * pixel,
        rim=circle[:, 2].astype(np.float64) * pixel,
        radius=radius.astype(np.float64),
        bounced=bounced.astype(np.float64),
        sector=sector,
    )


def _unit_bounce(press: F4, sigma: F4, circle: F4, radius: F4, film: Film, pixel: float) -> F4:
    """The light that balls in a film of albedo 1 throw on it and on the film around them.

    Less what `level_touches` has taken for drift: they brighten the film at rest, too.
    """
    yy, xx = np.mgrid[: press.shape[1], : press.shape[2]]
    height = np.zeros(press.shape[1:], np.float32)
    for (x, y, contact), size in zip(circle, radius, strict=True):
        square = ((xx - x) ** 2 + (yy - y) ** 2) * pixel**2
        rim = float(contact) * pixel
        depth = np.sqrt(np.maximum(size**2 - square, 0)) - np.sqrt(max(size**2 - rim**2, 0))
        height = np.where(square < rim**2, depth, height).astype(np.float32)
    thrown = film_bounce(press, height, film._replace(albedo=USUAL_ALBEDO), pixel)
    drift = film_drift(coarsen(1 + thrown), sigma, degree=DEGREE, rough=ROUGH)
    level = drift_gain(drift, height.shape) - 1
    return (thrown - level * press) / np.float32(USUAL_ALBEDO)


def grain(balls: Balls, left: F8, flat: F4, noise: F4) -> float:
    """What light departs from the model by, as a share of it, beyond the camera's noise."""
    level = np.median(flat.reshape(len(flat), -1), axis=1)[:, None]
    camera = (noise[0] * level * balls.light + noise[1]) / level**2
    whole = np.maximum(balls.light, FAINT)
    found = np.median(np.square(left / whole)) / 0.455
    alone = np.median(camera / whole**2)
    return float(np.sqrt(found - alone)) if found > NOISY**2 * alone else 0.0
