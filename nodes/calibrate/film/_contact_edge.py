"""The edge of a contact: inside the film is lit like the ball, outside like the film at rest."""

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F8, Film
from tactograph.nodes.calibrate.ball.ball_surface import away_on, ball_height
from tactograph.nodes.calibrate.ball.balls_on_film import MIN_WEIGHT_LIGHT, Beneath
from tactograph.nodes.calibrate.lights.light_samples import LIGHT_DEVIATION
from tactograph.nodes.optics.film import predict
from tactograph.nodes.optics.rest_shape import rest_share

MAX_EDGE_RATIO = 1.25
"""Radius up to which the edge is searched for over the known one, or the reverse."""
MAX_DEPARTURE = 0.15
"""Largest departure of the light that counts, because folding film matches neither model."""


def contact_edge(
    u: F8,
    v: F8,
    light: F8,
    thrown: F8,
    centre: tuple[float, float, float],
    radius: float,
    rim: float,
    film: Film,
    beneath: Beneath | None = None,
) -> float:
    """Return the radius in mm of a ball's contact that fits the light best.

    On a film that is glossy and lights itself, a contact is easily found too small, because the
    light at its foot is not that of a matt film.  A known film corrects this.  Light departs from
    the ball's by one spread inside the edge, and from that of the film at rest by another outside,
    where film may hang beside the ball: the edge makes both parts together likeliest (Hinkley
    1970).  The one from which the film at rest is nearer to the light than the ball would lie
    half-way down the hanging film.

    Parameters
    ----------
    u, v
        N positions in mm on the film at rest, up to `MAX_EDGE_RATIO` times `rim` from the ball's
        centre.
    light, thrown : K x N, the light as seen, and the part reflected from film to film
    centre, radius : of the ball, in mm
    rim : approximate radius of the contact, in mm
    film : the film's model
    beneath : the film at rest if it is no plane; the light is relative to a plane
    """
    cx, cy, cz = centre
    low, base = (0.0, 0.0) if beneath is None else (beneath.z, float(beneath.base[0]))
    away = away_on(u, v, low, base, centre, radius, film.camera)
    least = rim / MAX_EDGE_RATIO
    ring = (away > least) & (away < min(MAX_EDGE_RATIO * rim, radius))
    u, v, away, light, thrown = u[ring], v[ring], away[ring], light[:, ring], thrown[:, ring]
    if away.size < 2:
        return rim
    at_rest: F8 | float = 1.0
    if beneath is not None:
        below = beneath.only(ring)
        at_rest = rest_share(film, below.n, below.x, below.y, below.z)
    z = ball_height(u, v, (cx, cy, cz), radius, film.camera)
    x, y = u * (1 - film.camera * z), v * (1 - film.camera * z)
    n = np.stack([x - cx, y - cy, np.maximum(z - cz, 0)])
    n /= np.sqrt((n * n).sum(0))
    high = np.maximum(z, film.contact) if beneath is None else z
    on_ball = predict(film, n, x, y, high, None, np.full_like(z, film.contact)) + thrown
    # Both the far side of a ball and its shadow are dark.
    lit = light > MIN_WEIGHT_LIGHT
    inside, outside = (_departure(light - model, lit) for model in (on_ball, at_rest + thrown))
    order = np.argsort(away)
    within, beyond = np.cumsum(inside[order])[:-1], np.cumsum(outside[order][::-1])[-2::-1]
    count = np.arange(1, away.size)
    shares = (within, count), (beyond, away.size - count)
    unlikely = sum(n * np.log(np.maximum(part / n, LIGHT_DEVIATION**2)) for part, n in shares)
    return float(away[order[np.argmin(unlikely)]])


def _departure(residual: F8, lit: NDArray[np.bool_]) -> F8:
    """Departure without the LEDs' common part: at the foot, light from film to film is common."""
    common = (residual * lit).sum(0) / np.maximum(lit.sum(0), 1)
    return np.asarray((np.minimum(np.abs(residual - common), MAX_DEPARTURE) ** 2 * lit).sum(0))
