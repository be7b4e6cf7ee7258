"""Find the calibration ball: where it touches the film, and how large the contact is.

Long because a ball is refined, judged and refused by one model of its light.
"""

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Gt
from scipy import ndimage, optimize

from tactograph.graph import InputError, Port, node
from tactograph.nodes import F4, F8, Light, PixelSize
from tactograph.nodes.calibrate.ball.ball_on_shape import BallOnShape
from tactograph.nodes.calibrate.ball.ball_search import (
    CONTACT_SHARES,
    MAX_CONTACT_DIAGONALS,
    MIN_LIT_LIGHT,
    SHALLOW_SHARES,
    Circle,
    bases,
    reduced_to,
    rise_of,
    search_ball,
    share_of,
)
from tactograph.nodes.light.film_drift import CALM_DEPARTURES
from tactograph.nodes.optics.rest_shape import RestShape

MIN_GOODNESS = 0.45
"""Smallest goodness of a ball: balls reach 0.48 to 0.99, other objects up to 0.38."""
MIN_SHALLOW_GOODNESS = 0.6
"""Smallest goodness of a shallow contact: small parts of other objects are round, too."""
TEST_WIDTH_PX = 40
"""Width in px that the image is reduced to where no ball is found, to see whether anything is."""
REFINE_WIDTH_PX = 320
"""Width in px that the image is reduced to for the last step."""
MAX_REFINE_PIXELS = 3000
"""Most pixels that are fitted; three numbers need no more."""
GOODNESS_RADII = (0.97, 1.3, 1.8)
"""Radii as in `SEARCH_RADII`, for the goodness of the final circle; film folds up to the second."""
CONTACT_TRIALS = tuple(np.linspace(0.85, 1.15, 16))
"""Contact radii tried before the last descent, relative to that of the search."""
FOLD_KNOTS = (1.0, 1.07, 1.15, 1.25, 1.4, 1.6)
"""Radii, in contact radii, between which the film around the contact is interpolated."""
MIN_CONTACT_PX = 1.0
"""Smallest radius of a contact in px."""
RIDGE_SHARE = 1e-9
"""Ridge relative to the trace; keeps the normal equations solvable where pixels are few."""


class Ball(NamedTuple):
    """Contact circle of the ball, and its goodness."""

    center: Annotated[F4, Port("2", "px")]
    contact: Annotated[float, Port(unit="px")]
    goodness: Annotated[float, Port(unit="1")]


class _Samples(NamedTuple):
    """Pixels to fit: x and y of length N, light and lit K x N; the film if it is no plane."""

    x: F8
    y: F8
    light: F8
    lit: F8
    beneath: BallOnShape | None = None


@node
def find_ball(
    light: Light,
    pixel: PixelSize,
    shape: RestShape | None = None,
    *,
    radius_mm: Annotated[float, Gt(0)],
    center_px: tuple[float, float] | None = None,
    contact_px: Annotated[float, Gt(0)] | None = None,
) -> Ball:
    """Return the contact circle of a ball of known radius.

    On the ball the unit normal is known, n = ((x - c_x)/R, (y - c_y)/R, sqrt(1 - n_x^2 - n_y^2)),
    and the light of an LED is nearly linear in it (section 3.1: Lambert).  So for every
    candidate circle, linear least squares over the pixels that an LED reaches fits the light
    inside with 1, n_x, n_y, n_z and the light around it with a plain film.  The circle that
    explains most is the contact (variable projection: Golub and Pereyra, 1973).  The search
    correlates all centres at once on a reduced image, for eight radii; for eight smaller ones,
    down to a tenth of the ball, where those show none.  Nelder-Mead then
    refines the circle on a finer image, where the film around the contact may have any fold
    that is the same in all directions.

    Parameters
    ----------
    light : K x H x W, K from 3; relative to the film at rest, or as captured
    pixel : mm per px
    shape
        The film at rest if it is no plane.  Then the contact ends where the ball does not rise
        above it, and its radius is that of a ball as deep in a plane through the film there.
    radius_mm : the ball's radius
    center_px : x, y of the ball's centre, if known; it may lie outside the image
    contact_px : radius of the contact circle in px, if known

    Returns
    -------
    Centre x, y in px, where the ball is highest (pixel centres lie at integers); radius of the
    contact circle in px; and the goodness: the share of the light's variance in and around the
    contact, beyond a quadratic in x and y, that a ball on a plane explains.  1 is a perfect ball on
    an untouched film, 0 anything smooth.

    Raises
    ------
    InputError
        If no circle reaches a goodness of 0.45, unless centre and contact are both given; if
        the given contact is larger than the ball; if the contact is smaller than a pixel, lies
        beside the image or does not fit it.
    """
    radius = radius_mm / pixel
    if contact_px is not None and contact_px > radius:
        raise InputError(
            f"a contact of {contact_px:g} px is larger than the ball: its radius of {radius_mm:g} "
            f"mm is {radius:.1f} px; correct contact, radius or pixel size"
        )
    _check_size(light, radius, radius_mm, contact_px)
    if center_px is not None:
        _check_place(light, Circle(*center_px, contact_px or radius))
    if center_px is not None and contact_px is not None:
        circle = Circle(*center_px, contact_px)
        return _ball(circle, _goodness(light, circle, radius))
    first = search_ball(light, radius, center_px, contact_px)
    beneath = None if shape is None else BallOnShape(shape, radius_mm)
    circle = refined(light, first, radius, center_px, contact_px, beneath)
    goodness = _goodness(light, circle, radius)
    smallest = CONTACT_SHARES[-1] * radius
    if contact_px is None and (goodness < MIN_GOODNESS or circle.radius < smallest):
        first = search_ball(light, radius, center_px, None, SHALLOW_SHARES)
        shallow = refined(light, first, radius, center_px, None, beneath)
        better = _goodness(light, shallow, radius)
        if better > max(goodness, MIN_SHALLOW_GOODNESS):
            circle, goodness = shallow, better
    if goodness < MIN_GOODNESS:
        calm = CALM_DEPARTURES[0]
        in_view = (
            f"the best circle, at {circle.x:.0f},{circle.y:.0f} px, has a goodness of "
            f"{goodness:.2f} and {MIN_GOODNESS:g} is needed"
        )
        if (np.abs(reduced_to(light, TEST_WIDTH_PX)[0] - 1) < calm).all():
            in_view = (
                f"the press shows what the flat frame shows, within {calm:.0%} (has the one a "
                "ball, and the other untouched film?)"
            )
        raise InputError(
            f"no ball of radius {radius_mm:g} mm found: {in_view}; give its place (`center_px`=X,Y "
            "and `contact_px`=R), or press again"
        )
    return _ball(circle, goodness)


def oblong_of(light: F4, ball: Circle, radius: float) -> tuple[float, float, float]:
    """Return how oblong pixels are by a ball, and what square and such pixels leave of its light.

    Parameters
    ----------
    light, ball, radius
        K x H x W, the circle found, and the ball's radius in px, as if pixels were square.

    Returns
    -------
    Logarithm of a pixel's width over its length; two deviations on one scale, above 0.
    """
    reduced, shrink = reduced_to(light, REFINE_WIDTH_PX)
    start, limit = ball.on(shrink), radius / shrink
    samples = _sample(reduced, start, FOLD_KNOTS[-1])

    def residual(values: F8) -> float:
        x, y, contact, oblong = values
        wider = np.exp(oblong / 2)
        square = samples._replace(x=(samples.x - x) * wider, y=(samples.y - y) / wider)
        return _residual(square, Circle(0.0, 0.0, min(contact, limit)), limit)

    first, steps = np.array([*start, 0.0]), np.array([*[0.03 * start.radius] * 3, 0.05])
    free = _lowest(residual, first, steps, 0.002)
    square = _lowest(lambda place: residual(np.append(place, 0.0)), free.x[:3], steps[:3], 0.002)
    return float(free.x[3]), *np.sqrt(np.maximum([square.fun, free.fun], 1e-12)).tolist()


def _check_size(light: F4, radius: float, radius_mm: float, contact: float | None) -> None:
    """Refuse a ball or a contact below a pixel, and one that must be far larger than the image."""
    if radius < MIN_CONTACT_PX:
        raise InputError(
            f"a ball of {radius_mm:g} mm radius is {radius:.2g} px here and shows nothing; check "
            "its radius and the pixel size"
        )
    if contact is not None and contact < MIN_CONTACT_PX:
        raise InputError(
            f"a contact of {contact:g} px shows no ball; give its radius in px, from "
            f"{MIN_CONTACT_PX:g}, or leave it out and it is searched for"
        )
    smallest = contact if contact is not None else radius * min(CONTACT_SHARES)
    diagonal = float(np.hypot(*light.shape[1:]))
    if smallest > MAX_CONTACT_DIAGONALS * diagonal:
        raise InputError(
            f"the contact of a ball of {radius_mm:g} mm radius, {smallest:.3g} px, does not fit "
            f"the image of {light.shape[2]} x {light.shape[1]} px; check its radius, its contact "
            "and the pixel size"
        )


def _check_place(light: F4, circle: Circle) -> None:
    """Refuse a contact that lies beside the image."""
    rows, columns = light.shape[1:]
    beyond = [
        max(-at, at - (size - 1), 0.0) for at, size in ((circle.x, columns), (circle.y, rows))
    ]
    if np.hypot(*beyond) > circle.radius:
        raise InputError(
            f"a contact of {circle.radius:g} px at {circle.x:g},{circle.y:g} lies beside the image "
            f"of {columns} x {rows} px; correct the ball's place"
        )


def _ball(circle: Circle, goodness: float) -> Ball:
    return Ball(np.array([circle.x, circle.y], np.float32), float(circle.radius), goodness)


def _explained(normal: F8, right: F8) -> F8:
    """Return the sum of squares that the least-squares solution explains."""
    trace = np.trace(normal, axis1=-2, axis2=-1)[..., None, None]
    damped = normal + (RIDGE_SHARE * trace + 1e-12) * np.eye(normal.shape[-1])
    return np.sum(np.linalg.solve(damped, right[..., None])[..., 0] * right, axis=-1)


def refined(
    light: F4,
    seed: Circle,
    radius: float,
    center: tuple[float, float] | None,
    contact: float | None,
    beneath: BallOnShape | None,
) -> Circle:
    """Return the circle near `seed` that explains the light best, with subpixel accuracy."""
    reduced, shrink = reduced_to(light, REFINE_WIDTH_PX)
    circle = seed.on(shrink)
    limit = radius / shrink
    samples = _sample(reduced, circle, FOLD_KNOTS[-1])
    samples = samples._replace(beneath=beneath)
    if not samples.x.size:  # a place that was given, beside the image
        return seed
    place = [] if center is not None else [0, 1]
    size = [] if contact is not None else [2]
    # The search finds the centre to about a tenth of the contact radius.
    circle = _descend(samples, circle, limit, place, 0.1)
    if size:
        circle = min(
            (circle._replace(radius=min(s * seed.radius / shrink, limit)) for s in CONTACT_TRIALS),
            key=lambda trial: _residual(samples, trial, limit),
        )
    return _descend(samples, circle, limit, place + size, 0.03).on(1 / shrink)


def _descend(
    samples: _Samples, start: Circle, limit: float, free: list[int], step: float
) -> Circle:
    """Return the circle of least residual; only the fields `free` vary, first by `step` radii."""
    if not free:
        return start

    def circle(values: F8) -> Circle:
        full = np.array(start)
        full[free] = values
        return Circle(full[0], full[1], float(np.clip(full[2], 0.5 * start.radius, limit)))

    first, steps = np.array(start)[free], np.full(len(free), -step * start.radius)
    minimum = _lowest(lambda values: _residual(samples, circle(values), limit), first, steps, 0.02)
    return circle(minimum.x)


def _lowest(residual: Callable[[F8], float], first: F8, steps: F8, tolerance: float) -> Any:
    """The unknowns of least residual, as SciPy returns them; their tolerance ends the descent."""
    corners = first + np.vstack([np.zeros(first.size), np.diag(steps)])
    # The residual's scale is unknown.
    stop = {"initial_simplex": corners, "xatol": tolerance, "fatol": np.inf, "maxfev": 200}
    minimize: Any = optimize.minimize  # its stubs know no initial simplex
    return minimize(residual, first, method="Nelder-Mead", options=stop)


def _sample(light: F4, circle: Circle, reach: float) -> _Samples:
    """Return evenly spread pixels up to `reach` contact radii from the centre."""
    y, x = np.indices(light.shape[1:])
    # Pixels at a shadow's edge are partly lit, so they are left out.
    lit = np.stack(
        [ndimage.binary_erosion(i > MIN_LIT_LIGHT, border_value=1, iterations=2) for i in light]
    )
    near = np.flatnonzero(np.hypot(x - circle.x, y - circle.y) < reach * circle.radius)
    near = near[:: near.size // MAX_REFINE_PIXELS + 1]
    values = light.reshape(len(light), -1)[:, near].astype(np.float64)
    shone = lit.reshape(len(light), -1)[:, near].astype(np.float64)
    return _Samples(x.flat[near].astype(float), y.flat[near].astype(float), values, shone)


def _residual(samples: _Samples, circle: Circle, radius: float) -> float:
    """Return the residual sum of squares of a ball in a film that folds evenly around it."""
    dx, dy = samples.x - circle.x, samples.y - circle.y
    r = np.hypot(dx, dy)
    normal = [dx / radius, dy / radius, rise_of(r, radius)]
    if samples.beneath is not None:
        normal, r = samples.beneath.normals_at(samples.x, samples.y, circle, radius)
    # A pixel on the rim mixes ball and film by area.
    inside = np.clip(circle.radius - r + 0.5, 0, 1)
    ball = [inside, *(inside * part for part in normal)]
    away = np.maximum(r, 1e-9)
    turns = np.stack([np.ones_like(r), dx / away, dy / away])
    hats = [np.interp(r / circle.radius, FOLD_KNOTS, hat) for hat in np.eye(len(FOLD_KNOTS))]
    fold = ((1 - inside) * np.stack(hats))[:, None] * turns
    return float(_unexplained(samples, np.vstack([ball, fold.reshape(-1, r.size)])).sum())


def _unexplained(samples: _Samples, basis: F8) -> F8:
    """Return each LED's residual sum of squares on lit pixels, for a basis (columns x N)."""
    weighted = samples.lit * samples.light
    # Few pixels are not lit: to take them from all is faster than to weigh every pixel.
    dark = [basis[:, lit == 0] for lit in samples.lit]
    normal = basis @ basis.T - np.stack([unlit @ unlit.T for unlit in dark])
    power = np.sum(weighted * samples.light, axis=1)
    return power - _explained(normal, weighted @ basis.T)


def _goodness(light: F4, circle: Circle, radius: float) -> float:
    reduced, shrink = reduced_to(light, REFINE_WIDTH_PX)
    small = circle.on(shrink)
    samples = _sample(reduced, small, GOODNESS_RADII[2])
    u, v = (samples.x - small.x) / small.radius, (samples.y - small.y) / small.radius
    ball, smooth, window = bases(u, v, radius / circle.radius, GOODNESS_RADII)
    if not window.any():  # of a contact that the reduced image does not resolve
        return 0.0
    samples = samples._replace(lit=samples.lit * window)
    share = share_of(
        _unexplained(samples, ball), _unexplained(samples, smooth), window.sum() * len(light)
    )
    return float(np.clip(share, 0, 1))
