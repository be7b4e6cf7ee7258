"""Samples of balls pressed into a film, to which a film's model is fitted."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import NodeCall
from tactograph.nodes import F4, F8, U1, Film
from tactograph.nodes.calibrate import BALL_SLICES, DRIFT_DEGREE, FILM_ROUGHNESS, MAX_SAMPLE_SLOPE
from tactograph.nodes.calibrate.film._contact_edge import MAX_EDGE_RATIO, contact_edge
from tactograph.nodes.calibrate.film._light_pattern import MEDIAN_OF_SQUARES
from tactograph.nodes.calibrate.film.balls_on_film import Balls, ball_height, sunk
from tactograph.nodes.calibrate.film.film_fit import MAX_INDEPENDENT_SAMPLES
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.light.film_bounce import DEFAULT_MAX_CELLS, film_bounce
from tactograph.nodes.light.film_drift import drift_gain, film_drift
from tactograph.nodes.light.light_noise import light_noise
from tactograph.nodes.optics.near_light import places
from tactograph.nodes.optics.sheet import cut

FITTED_RADIUS_SHARE = 0.95
"""Share of a contact's radius that is fitted, because the film leaves the ball before the rim."""
MIN_SAMPLES = 30
"""Fewest samples of each ball."""
USUAL_ALBEDO = 0.6
"""Albedo of the film for which a bounce is computed."""
FINE_CELLS = 4 * DEFAULT_MAX_CELLS
"""Cells of `film_bounce` on a matt film, and in the last fit on one with a coat, which takes seven
times as long.  With coarser cells the light changes in steps with a ball's height or the rim."""
LIFT_SHARE = 0.02
"""Share of a ball's radius by which it is lifted, to differentiate a bounce by its height."""
MAX_SQUARED_RADIUS = 1 + 1e-6
"""Tolerance, relative to the squared radius, for a ray that meets a ball."""
RIM_STEP_MM = 0.5
"""mm by which the film is widened, to differentiate a bounce by the film's rim."""
MAX_NOISE_RATIO = 1.5
"""Multiple of the camera's noise up to which noise explains a departure."""


class _Press(NamedTuple):
    """A press, K x H x W, and the light that its film reflects onto itself.

    `bounced` is that of a film of albedo 1.  `by_lift` is its derivative by the balls' height
    (relative to their radius), `by_rim` that by the film's rim in mm.
    """

    light: F4
    bounced: F4
    by_lift: F4
    by_rim: F4


class _Thrown(NamedTuple):
    """Light from film to film, K x H x W, and what `level_touches` leaves of it.

    Balls also brighten the film at rest around them, which `level_touches` takes for drift.
    """

    whole: F4
    left: F4


def sample_balls(
    light: F4,
    flat: F4,
    circle: F4,
    radius: F4,
    of: NDArray[np.int32],
    film: Film,
    noise: F4,
    pixel: float,
    most: int | None = MAX_INDEPENDENT_SAMPLES,
    bare: U1 | None = None,
    shifts: F8 | None = None,
    rim: F8 | None = None,
    edges: bool = False,
    fine: bool = False,
    bounce: NodeCall = film_bounce,
) -> Balls:
    """Choose samples of the balls, spread evenly over each.

    Parameters
    ----------
    light : K x S x W, the presses relative to the film at rest, on a sheet (`sheet`)
    flat : K x H x W, the film at rest
    circle, radius, of : B x 3 in px, B in mm, and the press that each ball is in
    film : the film, whose LEDs and coat determine the light from film to film
    noise, pixel : (shot, read), mm per px
    most : most samples of all balls together, but at least `MIN_SAMPLES` of each; None: all pixels
    bare
        S x W, 0 on pixels that are left out.  None: no pixel is left out.
    shifts
        B x 3 in mm, by which a fit has moved the balls; they reflect light from there.  The
        light from film to film grows with the height of their flanks; `by_lift` tells the fit
        how much.
    rim : B contact radii in mm; None: those of `circle`
    edges
        Whether the light around a ball then determines where the film leaves it
        (`contact_edge`).
    fine
        Whether the film is the final one.  Then the light that its coat reflects is computed on
        fine cells, and a film without albedo reflects none onto itself.
    bounce
        `film_bounce`, on a device if there is one.  For a film that does not light itself, a few
        calls on the host take less time than to compile the kernels.
    """
    rows, columns = flat.shape[1:]
    x, y = places(columns, np.float32(pixel)), places(rows, np.float32(pixel))
    presses = cut(light, rows)
    sigma = coarsen(light_noise(flat, flat, noise))
    moved = np.zeros((len(circle), 3)) if shifts is None else shifts
    throw = bounce if lights_itself(film) else film_bounce
    if rim is not None:
        circle = np.column_stack([circle[:, :2], rim / pixel])
    thrown = {}
    for i in np.unique(of):
        balls = circle[of == i], radius[of == i], moved[of == i]
        thrown[i] = _thrown_on(presses[i], sigma, balls, film, pixel, fine, throw)
    if edges:
        masks = cut(np.ones(light.shape[1:], np.uint8) if bare is None else bare, rows)
        edge = np.empty(len(of))
        for number, i in enumerate(of):
            seen = thrown[i].light, masks[i], thrown[i].bounced
            placed = circle[number], float(radius[number]), moved[number]
            edge[number] = _edge(*seen, *placed, film, pixel)
        moved = moved_with(moved, radius, circle[:, 2] * pixel, edge)
        circle = np.column_stack([circle[:, :2], edge / pixel])
    parts: list[tuple[NDArray[Any], ...]] = []
    for number, i in enumerate(of):
        u0, v0, contact = circle[number].astype(np.float64)
        reach = min(
            FITTED_RADIUS_SHARE * contact,
            radius[number] / pixel * np.sin(np.arctan(MAX_SAMPLE_SLOPE)),
        )
        yy, xx = np.mgrid[
            max(0, int(v0 - reach)) : min(rows, int(v0 + reach) + 2),
            max(0, int(u0 - reach)) : min(columns, int(u0 + reach) + 2),
        ].reshape(2, -1)
        within = np.hypot(xx - u0, yy - v0) < reach
        if bare is not None:
            within &= bare[i * rows + yy, xx] > 0
        inside = np.flatnonzero(within)
        yy, xx = yy[inside], xx[inside]
        sector = np.floor(np.arctan2(yy - v0, xx - u0) / (2 * np.pi) % 1 * BALL_SLICES).astype(int)
        of_press = (part[:, yy, xx].astype(np.float64) for part in thrown[i])
        values, bounced, by_lift, by_rim = of_press
        by_lift /= radius[number].astype(np.float64)
        bounced -= moved[number, 2] * by_lift + film.rim * by_rim
        each_ball = values, bounced, by_lift, by_rim, np.full(xx.size, number), sector
        parts.append((x[xx], y[yy], *each_ball))
    u, v, values, bounced, by_lift, by_rim, ball, sector = (
        np.concatenate(part, axis=-1) for part in zip(*parts, strict=True)
    )
    middle = np.array([(columns - 1) / 2, (rows - 1) / 2])
    every = Balls(
        u=u.astype(np.float64),
        v=v.astype(np.float64),
        light=values.astype(np.float64),
        ball=ball,
        centre=(circle[:, :2].astype(np.float64) - middle) * pixel,
        rim=circle[:, 2].astype(np.float64) * pixel,
        radius=radius.astype(np.float64),
        bounced=bounced,
        by_lift=by_lift,
        by_rim=by_rim,
        sector=sector,
    )
    return every if most is None else thinned(every, most)


def lights_itself(film: Film) -> bool:
    """Return whether the film shows light reflected from other parts of the film."""
    return film.refraction > 1 or film.albedo > 0


def thinned(balls: Balls, most: int = MAX_INDEPENDENT_SAMPLES) -> Balls:
    """Return about `most` samples, evenly over each ball, but at least `MIN_SAMPLES` of each."""
    each = max(MIN_SAMPLES, most // len(balls.centre))
    first = np.searchsorted(balls.ball, np.arange(len(balls.centre) + 1))
    number = np.arange(balls.ball.size) - first[balls.ball]
    # A stride that does not divide the rows' length spreads the samples over all columns.
    return balls.only(number % (np.diff(first)[balls.ball] // each + 1) == 0)


def moved_with(shifts: F8, radius: NDArray[Any], before: NDArray[Any], rim: NDArray[Any]) -> F8:
    """Return the shifts of balls that stay in place while their contact radii change."""
    moved = shifts.copy()
    moved[:, 2] += sunk(radius, rim) - sunk(radius, before)
    return moved


def _edge(
    press: F4,
    bare: U1,
    thrown: F4,
    circle: F4,
    radius: float,
    shift: F8,
    film: Film,
    pixel: float,
) -> float:
    """The radius of a ball's contact in mm, from the light around it."""
    x, y, contact = (float(part) for part in circle)
    around = int(MAX_EDGE_RATIO * contact) + 2
    rows = slice(max(0, int(y) - around), int(y) + around + 2)
    columns = slice(max(0, int(x) - around), int(x) + around + 2)
    u, v = (places(side, np.float32(pixel)).astype(np.float64) for side in press.shape[:0:-1])
    centre = _centre(circle, radius, shift, press.shape[1:], pixel)
    across, down = (part.ravel() for part in np.meshgrid(u[columns], v[rows]))
    # Film under markers counts as dark, so that `contact_edge` ignores it.
    seen, bounced = (
        plane.reshape(len(press), -1).astype(np.float64)
        for plane in (
            press[:, rows, columns] * bare[rows, columns],
            film.albedo * thrown[:, rows, columns],
        )
    )
    return contact_edge(across, down, seen, bounced, centre, radius, contact * pixel, film)


def _centre(
    circle: F4, radius: float, shift: F8, size: tuple[int, ...], pixel: float
) -> tuple[float, float, float]:
    """A ball's centre in mm, moved by `shift`; it may lie outside an image of H x W pixels."""
    x, y, contact = (float(part) for part in circle)
    rows, columns = size
    u, v = (x - (columns - 1) / 2) * pixel, (y - (rows - 1) / 2) * pixel
    deep = float(sunk(radius, contact * pixel))
    return float(u + shift[0]), float(v + shift[1]), float(shift[2] - deep)


def _thrown_on(
    press: F4,
    sigma: F4,
    balls: tuple[F4, F4, F8],
    film: Film,
    pixel: float,
    fine: bool,
    bounce: NodeCall,
) -> _Press:
    """The light from film to film on a press with these balls (circles, radii and shifts)."""
    if fine and film.albedo == 0:
        nothing = np.zeros_like(press)
        return _Press(press, nothing, nothing, nothing)
    circle, radius, shifts = balls
    size = press.shape[1:]
    v, u = (places(side, np.float32(pixel)).astype(np.float64) for side in size)

    def thrown(film: Film, cells: int, lift: float = 0) -> _Thrown:
        """The light that a film of albedo 1, with the balls in it, reflects onto itself."""
        height = np.zeros(size)
        lifted = shifts + lift * radius[:, None] * np.array([0, 0, 1])
        for each, r, shift in zip(circle, radius, lifted, strict=True):
            cx, cy, cz = _centre(each, r, shift, size, pixel)
            z = ball_height(u, v[:, None], (cx, cy, cz), r, film.camera)
            nearer = 1 - film.camera * z
            away = (u * nearer - cx) ** 2 + (v[:, None] * nearer - cy) ** 2 + (z - cz) ** 2
            height = np.maximum(height, np.where(away < MAX_SQUARED_RADIUS * r**2, z, 0))
        seen = (height / (1 - film.camera * height)).astype(np.float32)
        light = bounce(press, seen, film._replace(albedo=USUAL_ALBEDO), pixel, cells=cells)
        # Balls are not film at rest, although little light is reflected onto their tops.
        shown = np.where(seen > 0, press, 1 + light)
        drift = film_drift(coarsen(shown), sigma, degree=DRIFT_DEGREE, rough=FILM_ROUGHNESS)
        level = (drift_gain(drift, size) - 1) * press
        whole, taken = light / np.float32(USUAL_ALBEDO), level / np.float32(USUAL_ALBEDO)
        return _Thrown(whole, whole - taken)

    # A coat changes the amount of light; its growth with a ball's height is taken from matt film.
    matt, wider = film._replace(refraction=1.0), film._replace(rim=film.rim + RIM_STEP_MM)
    bounced = on_matt = thrown(matt, FINE_CELLS)
    by_lift = (thrown(matt, FINE_CELLS, LIFT_SHARE).left - on_matt.left) / LIFT_SHARE
    if film.refraction == 1:
        by_rim = thrown(wider, FINE_CELLS).left - bounced.left
    else:
        bounced = thrown(film, DEFAULT_MAX_CELLS)
        by_lift *= bounced.left.mean() / on_matt.left.mean()
        by_rim = thrown(wider, DEFAULT_MAX_CELLS).left - bounced.left
        bounced = thrown(film, FINE_CELLS) if fine else bounced
    if film.albedo > 0:
        press = _levelled(press, sigma, bounced, film.albedo)
    return _Press(press, bounced.left, by_lift, by_rim / np.float32(RIM_STEP_MM))


def _levelled(press: F4, sigma: F4, thrown: _Thrown, albedo: float) -> F4:
    """Level a press again, with the known light from film to film not taken for drift.

    For a film of this albedo, the press minus the light from film to film then is the LEDs'
    light.  For another albedo, `left` accounts for what would have been taken for drift.
    """
    known = coarsen(np.float32(albedo) * thrown.whole)
    drift = film_drift(
        coarsen(press), sigma, bounced=known, degree=DRIFT_DEGREE, rough=FILM_ROUGHNESS
    )
    taken = np.float32(albedo) * (thrown.whole - thrown.left)
    return np.asarray(press / drift_gain(drift, press.shape[1:]) - taken, np.float32)


def grain(balls: Balls, left: F8, flat: F4, noise: F4) -> float:
    """Relative standard deviation of the light from the model, beyond the camera's noise."""
    level = np.median(flat.reshape(len(flat), -1), axis=1)[:, None]
    camera = (noise[0] * level * balls.light + noise[1]) / level**2
    variance = np.median(np.square(left / balls.reference_light)) / MEDIAN_OF_SQUARES
    alone = np.median(camera / balls.reference_light**2)
    return float(np.sqrt(variance - alone)) if variance > MAX_NOISE_RATIO**2 * alone else 0.0
