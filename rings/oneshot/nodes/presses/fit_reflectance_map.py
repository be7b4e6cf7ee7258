"""Fit a reflectance that varies over the film to many presses of a ball.

Long because map, centres and the rim's height depend on one another and are fitted in turn.
"""

from typing import Annotated, NamedTuple, Self

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray

from tactograph.rings.oneshot.nodes.map.reflectance_map import (
    NO_LIGHT,
    PLACE_DEGREE,
    PLACE_TERMS,
    RIDGE_SHARE,
    SHADE_COUNT,
    ReflectanceMap,
    predicted,
    robust_weights,
    shades,
    terms,
)
from tactograph.rings.oneshot.nodes.map.slope_in_shadow import slope_in_shadow
from tactograph.rings.oneshot.nodes.map.smooth_slope import smooth_slope
from tactograph.rings.oneshot.nodes.map.solve_reflectance_map import solve_reflectance_map
from tactograph.rings.oneshot.nodes.presses import Circles, PressImages
from tactograph.rings.oneshot.nodes.presses.find_presses import MIN_PRESSES
from tactograph.sdk import (
    F4,
    F8,
    FoundBalls,
    InputError,
    Light,
    PixelSize,
    Port,
    PressedBall,
    node,
    robust_deviation,
    warn,
)
from tactograph.sdk.nodes import (
    coarsen,
    coarsen_pixel,
    enlarge_height,
    flat_presses,
    integrate_dct,
    rest_at_border,
)

PIXELS_PER_PRESS = 120
"""Number of pixels fitted per press: 27 functions of the slope need no more."""
FITTED_RADIUS_SHARE = 0.85
"""Share of the contact's radius that is fitted: the film leaves the ball before the rim."""
ROUGH_PASSES = 2
"""Solutions for the slope on cells, each with the height of the one before."""
MAX_RIM_PRESSES = 7
"""Most presses that measure the height of the contact's rim."""
FIRST_RIM_MM = 0.2
"""Start value of the rim's height in mm."""
RIM_ROUNDS, FIT_ROUNDS = 2, 3
"""Rounds that find the height of the rim, and the weights of a fit."""
MAX_DEVIATIONS = 6.0
"""A press is an outlier above this many robust standard deviations of the residuals ..."""
MAX_MEDIANS = 2.5
"""... and above this multiple of their median."""
MAX_CENTRE_STEP_PX = 2.0
"""Longest step of a centre in px."""
DARK_LIGHT = 0.3
"""Light, over that of film at rest, up to which film may be turning away from an LED."""
STEEP_SLOPES, STEEP_AZIMUTH_COUNT = (1.5, 3.0, 6.0), 8
"""Slopes beyond those of balls, and their azimuths, at which Lambert's law stands for light."""
LAMBERT_DEVIATION = 0.3
"""Standard deviation of light there from Lambert's law.  Harmonics of second order miss a cosine
that ends at zero by 0.15 to 0.2, and a coat lights and darkens film by as much again."""


class MapFit(NamedTuple):
    """The map, the circles refined with it, and its residual."""

    reflectance: ReflectanceMap
    circle: Circles
    selection: Annotated[NDArray[np.uint8], Port("B", "flag", high=1)]
    rim: Annotated[float, Port(unit="mm")]
    residual: Annotated[F4, Port("K", "1")]


class Pixels(NamedTuple):
    """Pixels of one press that are fitted."""

    x: F8
    y: F8
    """Of length N, in px."""
    place: F8
    """Their `terms`, 15 x N."""
    light: F8
    """Light less 1, K x N."""
    weight: F8
    """K x N."""


class Bench(NamedTuple):
    """Inputs of every step of the fit: relative light of each ball's press, film at rest,
    ball radius in px, mm per px, and degree of the polynomials."""

    light: list[F4]
    flat: F4
    radius: float
    pixel: float
    degree: int

    @classmethod
    def of(
        cls,
        image: F4,
        flat: F4,
        radius_mm: float,
        pixel: float,
        degree: int,
        balls: FoundBalls | None = None,
    ) -> Self:
        """Return the inputs for presses P x K x H x W; `balls` of None: one in every press."""
        light = [flat_presses(press, flat) for press in image]
        press_light = light if balls is None else [light[press] for press in balls.of]
        return cls(press_light, flat, radius_mm / pixel, pixel, degree)

    @property
    def shape(self) -> tuple[int, int]:
        return int(self.flat.shape[1]), int(self.flat.shape[2])

    def ball(self, circle: F8) -> PressedBall:
        """Return the ball that made a contact."""
        return PressedBall(circle, self.radius, self.pixel)

    def pixels(self, press: int, circle: F8, most: int = PIXELS_PER_PRESS) -> Pixels:
        """Return pixels evenly spread over the inner part of a contact circle (x, y, radius)."""
        y, x = np.indices(self.shape).reshape(2, -1)
        reach = FITTED_RADIUS_SHARE * circle[2]
        inside = np.flatnonzero(np.hypot(x - circle[0], y - circle[1]) < reach)
        # A stride that does not divide the rows' length spreads the pixels over all columns.
        inside = inside[:: inside.size // most + 1]
        place = x[inside].astype(np.float64), y[inside].astype(np.float64)
        light, weight = (
            planes.reshape(len(planes), -1)[:, inside].astype(np.float64)
            for planes in (self.light[press], self.flat)
        )
        return Pixels(*place, terms(*place, self.shape), light - 1, weight)

    def shades(self, circle: F8, pixels: Pixels, rim: float) -> F8:
        """Return B of equation M1 on a ball whose contact's rim is lifted by `rim` mm."""
        slope, rise = self.ball(circle).shape(pixels.x, pixels.y)
        return shades(slope, rise + rim)

    def fit_presses(
        self, circles: F8, is_used: np.ndarray, rim: float, rounds: int
    ) -> tuple[F8, F8]:
        """Update map and centres in turn; return both."""
        circles = circles.copy()
        for _ in range(rounds):
            reflectance = self._map(circles, is_used, rim)
            for press in np.flatnonzero(is_used).tolist():
                circles[press] = self.refine_center(reflectance, circles[press], press, rim)
        return self._map(circles, is_used, rim), circles

    def refine_center(
        self, reflectance: F8, circle: F8, press: int, rim: float, steps: int = 2
    ) -> F8:
        """Move a circle to where the map explains the press best: robust Gauss-Newton."""
        circle = circle.copy()
        pixels = self.pixels(press, circle)
        nudge = 0.1
        for _ in range(steps):
            residual, by_x, by_y = (
                self._misfit(reflectance, circle + nudge * np.array(d), pixels, rim)
                for d in ((0, 0, 0), (1, 0, 0), (0, 1, 0))
            )
            jacobian = np.stack([by_x - residual, by_y - residual]) / nudge
            weighted = jacobian * robust_weights(residual, pixels.weight)
            normal = np.einsum("akn,bkn->ab", weighted, jacobian)
            move = -np.linalg.solve(
                normal + 1e-9 * np.trace(normal) * np.eye(2),
                np.einsum("akn,kn->a", weighted, residual),
            )
            circle[:2] += move * min(1.0, MAX_CENTRE_STEP_PX / max(float(np.hypot(*move)), 1e-9))
        return circle

    def reconstruct(self, reflectance: F8, press: int, deviation: float = 0.0) -> tuple[F4, F4]:
        """Return slope and height of a press, as the graph `gelsight_mini` computes them."""
        light, coefficients = self.light[press], reflectance.astype(np.float32)
        light_c, flat_c, pixel_c = coarsen(light), coarsen(self.flat), coarsen_pixel(self.pixel)
        height = np.zeros(light_c.shape[1:], np.float32)
        for _ in range(ROUGH_PASSES):
            slope = _slope(light_c, flat_c, height, coefficients, deviation)
            height = rest_at_border(integrate_dct(slope, pixel_c))
        slope = _slope(light, self.flat, enlarge_height(height, light), coefficients, deviation)
        slope = smooth_slope(slope)
        return slope, rest_at_border(integrate_dct(slope, self.pixel))

    def measure_rim(self, reflectance: F8, circles: F8, is_used: np.ndarray) -> float:
        """Return the median height in mm by which the film lifts the rims of some presses."""
        some = np.flatnonzero(is_used)[:: int(is_used.sum()) // MAX_RIM_PRESSES + 1]
        return float(np.median([self._rim(reflectance, circles[i], i) for i in some]))

    def residuals(self, reflectance: F8, circles: F8, is_used: np.ndarray, rim: float) -> F8:
        """Root mean square residuals of the presses under the map, P x K; 0 where left out."""
        residuals = np.zeros((len(circles), len(self.flat)))
        for i in np.flatnonzero(is_used).tolist():
            residual = self._misfit(reflectance, circles[i], self.pixels(i, circles[i]), rim)
            residuals[i] = np.sqrt(np.mean(residual**2, axis=1))
        return residuals

    def outliers(self, reflectance: F8, circles: F8, is_used: np.ndarray, rim: float) -> np.ndarray:
        """Flag the remaining presses that the map explains far worse than the rest."""
        squares = np.square(self.residuals(reflectance, circles, is_used, rim))
        residual = np.zeros(len(circles))
        for i in np.flatnonzero(is_used).tolist():
            # Dim, noisy lights count less.
            y, x = np.clip(circles[i, 1::-1].round().astype(int), 0, np.subtract(self.shape, 1))
            residual[i] = np.sqrt(np.average(squares[i], weights=self.flat[:, y, x]))
        middle = np.median(residual[is_used])
        spread = robust_deviation(residual[is_used] - middle)
        high = max(middle + MAX_DEVIATIONS * spread, MAX_MEDIANS * middle)
        return np.asarray(is_used & (residual > high))

    def _rim(self, reflectance: F8, circle: F8, press: int) -> float:
        _, height = self.reconstruct(reflectance, press)
        y, x = (i.astype(np.float64) for i in np.indices(self.shape))
        _, rise = self.ball(circle).shape(x, y)
        distance = np.hypot(x - circle[0], y - circle[1]) / circle[2]
        ring = (distance > 0.8) & (distance < 0.95)
        return float(np.median((height - rise)[ring]))

    def _misfit(self, reflectance: F8, circle: F8, pixels: Pixels, rim: float) -> F8:
        """Residual of a press's light under the map: K x N."""
        shade = self.shades(circle, pixels, rim)
        return pixels.light - predicted(reflectance, shade, pixels.place)

    def _map(self, circles: F8, is_used: np.ndarray, rim: float) -> F8:
        """Robust least squares over all used presses: K x 9 x 15."""
        used = (self.degree + 1) * (self.degree + 2) // 2
        rows, light, weight = [], [], []
        for press in np.flatnonzero(is_used).tolist():
            pixels = self.pixels(press, circles[press])
            shade = self.shades(circles[press], pixels, rim)
            rows.append((shade[:, None] * pixels.place[:used]).reshape(SHADE_COUNT * used, -1))
            light.append(pixels.light)
            weight.append(pixels.weight)
        basis, lights = np.concatenate(rows, axis=1), np.concatenate(light, axis=1)
        weights = np.concatenate(weight, axis=1)
        x, y, _ = circles[is_used].T
        steep = _steep_film(terms(x, y, self.shape)[:used])
        reflectance = np.zeros((len(lights), SHADE_COUNT, PLACE_TERMS))
        for k, (plane, even) in enumerate(zip(lights, weights, strict=True)):
            lambertian = _lamberts_law(basis, plane, even, steep)
            fitted = _robust_fit(basis, plane, even / even.mean(), steep, lambertian)
            reflectance[k, :, :used] = fitted.reshape(SHADE_COUNT, used)
        return reflectance


@node
def fit_reflectance_map(
    image: PressImages,
    flat: Light,
    names: list[str],
    circle: Circles,
    pixel: PixelSize,
    balls: FoundBalls | None = None,
    *,
    radius_mm: Annotated[float, Gt(0)],
    rounds: Annotated[int, Interval(ge=1, le=50)] = 5,
) -> MapFit:
    """Fit the coefficients of equation M1 (`reflectance_map`) to the presses.

    Robust least squares over the contacts, where the ball gives slope and height, alternates
    with moving each circle's centre to where the map explains its press best.  A press that
    the common map explains far worse than the others is an outlier and is left out.  The map
    itself measures the height to which the film lifts the contact's rim, and this height is
    fed back.

    Parameters
    ----------
    image, flat : P x K x H x W presses and the K x H x W film at rest
    names : the balls' names, for messages
    circle : B x 3 in px, as `find_presses` returns it; balls of radius 0 are left out
    pixel : mm per px
    balls : as `find_presses` returns them; None: every press has one ball
    radius_mm : the ball's radius
    rounds : how often map and centres are updated

    Returns
    -------
    Coefficients K x 9 x 15; circles B x 3; `selection` B, 0 for outliers; height of the contact's
    rim above the film at rest in mm; root mean square residual of length K, relative to the film at
    rest.

    Raises
    ------
    InputError
        If fewer than 4 presses are left.
    """
    selection = circle[:, 2] > 0
    bench = Bench.of(image, flat, radius_mm, pixel, degree_for(int(selection.sum())), balls)
    circles = circle.astype(np.float64)
    rim = FIRST_RIM_MM
    reflectance, circles = bench.fit_presses(circles, selection, rim, rounds)
    outliers = bench.outliers(reflectance, circles, selection, rim)
    for press in np.flatnonzero(outliers):
        warn(f"press {names[press]} is left out: its light does not fit that of the others")
    selection &= ~outliers
    if selection.sum() < MIN_PRESSES:
        raise InputError(
            f"{int(selection.sum())} presses agree, and {MIN_PRESSES} are needed; press more"
        )
    for _ in range(RIM_ROUNDS):
        reflectance, circles = bench.fit_presses(circles, selection, rim, 1)
        rim = bench.measure_rim(reflectance, circles, selection)
    reflectance, circles = bench.fit_presses(circles, selection, rim, 1)
    residuals = bench.residuals(reflectance, circles, selection, rim)
    return MapFit(
        reflectance.astype(np.float32),
        circles.astype(np.float32),
        selection.astype(np.uint8),
        rim,
        np.sqrt(np.mean(np.square(residuals[selection]), axis=0)).astype(np.float32),
    )


def degree_for(presses: int) -> int:
    """The highest degree whose monomials are at most half as many as the presses."""
    fitting = [d for d in range(PLACE_DEGREE + 1) if (d + 1) * (d + 2) <= presses]
    return max(fitting, default=0)


def _slope(light: F4, flat: F4, height: F4, reflectance: F4, deviation: float) -> F4:
    slope = solve_reflectance_map(light, flat, height, reflectance)
    return slope_in_shadow(slope, light, flat, height, reflectance, deviation)


def _steep_film(place: F8) -> F8:
    """The columns of the fit for film at these places that is steeper than balls are."""
    turn = 2 * np.pi * np.arange(STEEP_AZIMUTH_COUNT) / STEEP_AZIMUTH_COUNT
    tilt = np.multiply.outer(np.stack([np.cos(turn), np.sin(turn)]), STEEP_SLOPES).reshape(2, -1)
    shade = shades(tilt, np.zeros(tilt.shape[1]))
    return (shade[:, None, :, None] * place[:, None, :]).reshape(SHADE_COUNT * len(place), -1)


def _lamberts_law(basis: F8, light: F8, even: F8, steep: F8) -> F8:
    """Return light less 1 of steep film by Lambert's law, with directions as balls show them.

    A light from direction (a, b, 1) times any length makes n_x a + n_y b + n_z of film, relative
    to film at rest, and nothing of film that faces away.
    """
    used = len(basis) // SHADE_COUNT
    across, upright = basis[: 2 * used], basis[2 * used]
    lit = even * (light > DARK_LIGHT - 1)
    weight, direction = lit, np.zeros(2 * used)
    for _ in range(FIT_ROUNDS):
        weighted = across * weight
        normal = weighted @ across.T
        ridge = RIDGE_SHARE * np.diag(np.diag(normal) + 1e-12)
        direction = np.linalg.solve(normal + ridge, weighted @ (light - upright))
        weight = robust_weights(light - upright - direction @ across, lit)
    return np.maximum(steep[2 * used] + direction @ steep[: 2 * used], NO_LIGHT)


def _robust_fit(basis: F8, light: F8, even: F8, steep: F8, lambertian: F8) -> F8:
    """Iteratively reweighted least squares: columns x N, N, N; and of steep film, which is held.

    A pixel's light errs by the residual's spread, that of steep film by `LAMBERT_DEVIATION`.
    """
    weight, steep_weight = even, np.zeros(1)
    for _ in range(FIT_ROUNDS + 1):
        weighted, weighted_steep = basis * weight, steep * steep_weight
        normal = weighted @ basis.T + weighted_steep @ steep.T
        ridge = RIDGE_SHARE * np.diag(np.diag(normal) + 1e-12)
        product = weighted @ light + weighted_steep @ lambertian
        coefficients: F8 = np.asarray(np.linalg.solve(normal + ridge, product), np.float64)
        model_light = coefficients @ basis
        residual = light - np.maximum(model_light, NO_LIGHT)
        weight = robust_weights(residual, even * (model_light > NO_LIGHT))
        spread = np.square(robust_deviation(residual) / LAMBERT_DEVIATION)
        steep_weight = spread * ((coefficients @ steep > NO_LIGHT) | (lambertian > NO_LIGHT))
    return coefficients
