"""LED positions: a least-squares fit to known shapes and to the fall-off over the film.

An LED is described by L_x / L_z, L_y / L_z, 1 / L_z, which stay finite for a distant LED, and
the logarithm of its strength.  Each known shape also has a shift.  A ball is found only to a
fraction of a pixel.  Its height depends on the contact radius (for half a ball, a hundredth of a
pixel is a tenth of a millimetre) and on how high the film lifts the rim.
"""

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from scipy.linalg import hadamard

from tactograph.nodes import F4, F8, OTHER_PLACES
from tactograph.nodes.calibrate import SHIFT_DEVIATION_PX
from tactograph.nodes.calibrate.lights.descend import by_differences, huber, least_squares
from tactograph.nodes.calibrate.lights.light_samples import DIM_LIGHT, LIGHT_DEVIATION, Object, Rest
from tactograph.nodes.optics.near_light import irradiance_ratio

INFINITY_MM = 1e6
"""Distance in mm that counts as infinite."""
HEIGHT_DEVIATION_MM = 0.2
"""Standard deviation of a known shape's height above the film."""
SHIFT_DEVIATIONS = np.array([SHIFT_DEVIATION_PX, SHIFT_DEVIATION_PX, HEIGHT_DEVIATION_MM])
"""Of x and y in px, and of the height in mm."""
MIN_INVERSE_HEIGHT_RATIO = 0.25
"""Smallest 1 / L_z of a sampled LED, relative to its own, so that it stays above the film."""
MIN_OVER = 1e-3
"""Least irradiance of the film at rest, in units of L_z, that is divided by."""
DERIVATIVE_STEP = float(np.sqrt(np.finfo(np.float64).eps))
"""Relative step of the numeric derivative: the square root of the rounding error."""


class LedPlaces(NamedTuple):
    """LEDs by L_x / L_z, L_y / L_z and 1 / L_z, ... x K x 3; what follows is not read."""

    values: F8

    @classmethod
    def of(cls, lights: F4 | F8) -> Self:
        """Return LEDs at positions in mm, ... x K x 3."""
        ends = lights[..., :2] / lights[..., 2:]
        nearness = 1 / np.minimum(lights[..., 2:], INFINITY_MM)
        return cls(np.concatenate([ends, nearness], axis=-1).astype(np.float64))

    @property
    def positions(self) -> F8:
        """Positions in mm of K LEDs."""
        ends = np.column_stack([self.values[:, :2], np.ones(len(self.values))])
        return np.asarray(ends / np.maximum(self.values[:, 2:3], 1 / INFINITY_MM))

    def sampled(self, spread: F8, width_mm: float) -> F4:
        """Return LED positions sampled from a known covariance, 8 x K x 3 in mm.

        Parameters
        ----------
        spread : 3 K x 3 K, the covariance of the K LEDs
        width_mm : width of the film that the camera sees
        """
        leds = self.values[:, :3]
        unit = np.tile([1, 1, 2 / width_mm], len(leds))
        variance, direction = np.linalg.eigh(spread / np.outer(unit, unit))
        deviation = np.sqrt(np.maximum(variance[-OTHER_PLACES:], 0))
        modes = direction[:, -OTHER_PLACES:] * deviation * unit[:, None]
        changes = hadamard(OTHER_PLACES) @ modes.T
        others = []
        for change in changes.reshape(OTHER_PLACES, len(leds), 3):
            moved = leds + change
            moved[:, 2] = np.maximum(moved[:, 2], MIN_INVERSE_HEIGHT_RATIO * leds[:, 2])
            others.append(LedPlaces(moved).positions.astype(np.float32))
        return np.stack(others)


@dataclass(frozen=True)
class LedFit:
    """A fit: K x 4 unknowns of the LEDs, P x 3 shifts in px and mm; whether it had a flat frame."""

    leds: F8
    shifts: F8
    flat: bool

    @staticmethod
    def of(
        objects: list[Object],
        rest: Rest | None,
        width_mm: float,
        start: "LedFit | None" = None,
        slants: F4 | None = None,
    ) -> "LedFit":
        """Fit LEDs and shifts to all objects and the film at rest: robust least squares (Huber).

        Slants K x 2, if given, are where the search for the LEDs starts.
        """
        flat = rest is not None
        count = len(objects[0].light)
        if start is None:
            leds = np.array([_distant(objects, k, width_mm, flat) for k in range(count)])
            if slants is not None:
                leds[:, :2] = slants
        else:
            leds = start.leds
        shifts = np.zeros((len(objects), 3))

        def placed(unknown: F8) -> LedFit:
            own = unknown[: 4 * count].reshape(count, 4), unknown[4 * count :].reshape(-1, 3)
            return LedFit(*own, flat)

        def residual(unknown: F8) -> F8:
            return placed(unknown).residuals(objects, rest)

        def jacobian(unknown: F8) -> F8:
            return placed(unknown).jacobian(objects, rest)

        solution = least_squares(residual, np.r_[leds.ravel(), shifts.ravel()], jacobian=jacobian)
        return placed(solution)

    @property
    def lights(self) -> F4:
        """Positions K x 3 in mm from the middle of the image."""
        return LedPlaces(self.leds).positions.astype(np.float32)

    @property
    def strength(self) -> F4:
        """The film's light in the middle of the image if there was no flat frame, else 1."""
        strength = np.ones(len(self.leds)) if self.flat else np.exp(self.leds[:, 3])
        return strength.astype(np.float32)

    def object_residuals(self, objects: list[Object]) -> F8:
        """Light minus model on all objects, K x N; zero where an LED does not reach."""
        each = zip(objects, self.shifts, strict=True)
        return np.hstack([residual_of(o, self.leds, shift, self.flat) for o, shift in each])

    def residuals(self, objects: list[Object], rest: Rest | None) -> F8:
        """Residuals of shifts, the objects' light and the film at rest, in standard deviations."""
        leds, shifts, flat = self.leds, self.shifts, rest is not None
        residuals = [residual_of(o, leds, s, flat) for o, s in zip(objects, shifts, strict=True)]
        return np.concatenate(
            [
                (shifts / SHIFT_DEVIATIONS).ravel(),
                *(part.ravel() / LIGHT_DEVIATION for part in residuals),
                *_rest_residual(rest, leds),
            ]
        )

    def cost(self, objects: list[Object], rest: Rest | None) -> float:
        """Return Huber's loss of the residuals, the least of which `of` finds."""
        return huber(self.residuals(objects, rest))

    def jacobian(self, objects: list[Object], rest: Rest | None) -> F8:
        """Derivatives by differences; an LED affects its own light, a shift its own object."""
        leds, shifts, flat = self.leds, self.shifts, rest is not None
        ends = np.cumsum([shifts.size, *(press.light.size for press in objects)])
        at_rest = np.concatenate([np.empty(0), *_rest_residual(rest, leds)])
        jacobian = np.zeros((int(ends[-1]) + at_rest.size, leds.size + shifts.size))
        own, every = np.arange(shifts.size), np.arange(len(leds))
        jacobian[own, leds.size + own] = np.tile(1 / SHIFT_DEVIATIONS, len(objects))
        steps = DERIVATIVE_STEP * np.maximum(1.0, np.abs(leds))
        for i, (press, shift) in enumerate(zip(objects, shifts, strict=True)):
            moved, rows = press.moved(shift), jacobian[ends[i] : ends[i + 1]]
            before = _residual(press, *moved, leds, flat)
            by_led = rows.reshape(len(leds), -1, len(jacobian.T))
            for j, column in enumerate(np.eye(leds.shape[1])):
                after = _residual(press, *moved, leds + steps * column, flat)
                change = (after - before) / steps[:, j, None] / LIGHT_DEVIATION
                by_led[every, :, leds.shape[1] * every + j] = change

            def residual(by: F8, press: Object = press) -> F8:
                return residual_of(press, leds, by, flat).ravel() / LIGHT_DEVIATION

            first = leds.size + 3 * i
            rows[:, first : first + 3] = by_differences(residual, shift, 1)
        for unknown, step in enumerate(steps.ravel() if flat else ()):
            changed = leds.ravel() + step * (np.arange(leds.size) == unknown)
            after = np.concatenate(_rest_residual(rest, changed.reshape(leds.shape)))
            jacobian[ends[-1] :, unknown] = (after - at_rest) / step
        return jacobian


def other_places(objects: list[Object], rest: Rest | None, placed: LedFit, width_mm: float) -> F4:
    """Return LED positions sampled from the uncertainty of the fit, 8 x K x 3 in mm.

    The covariance of the unknowns is that of least squares, from the residuals of the objects
    and of the film at rest.  The eight directions in which the light over the image is least
    certain are combined with the signs of a Hadamard matrix's rows, so that the squares of their
    effects add up exactly.
    """
    leds = placed.leds
    slopes = placed.jacobian(objects, rest)
    on_objects = placed.object_residuals(objects)
    on_film = np.concatenate([np.zeros(1), *_rest_residual(rest, leds)])
    lit = np.hstack([press.lit for press in objects])
    first, last = placed.shifts.size, placed.shifts.size + on_objects.size
    noise = np.ones(len(slopes))
    noise[first:last] = np.square(on_objects).sum() / max(lit.sum(), 1) / LIGHT_DEVIATION**2
    noise[last:] = np.square(on_film).mean()
    scale = np.sqrt(np.maximum((slopes * slopes).sum(axis=0), 1e-30))
    slopes = slopes / scale
    inverse = np.linalg.pinv(slopes.T @ slopes, rcond=1e-12, hermitian=True)
    spread = inverse @ (slopes.T @ (slopes * noise[:, None])) @ inverse / np.outer(scale, scale)

    places = [4 * k + j for k in range(len(leds)) for j in range(3)]
    return LedPlaces(leds).sampled(spread[np.ix_(places, places)], width_mm)


def shift_of(press: Object, placed: LedFit) -> F8:
    """Fit the object's shift (x, y, z) in px and mm from where it was found, under known LEDs."""
    weight = 1 / SHIFT_DEVIATIONS

    def residual(shift: F8) -> F8:
        residuals = residual_of(press, placed.leds, shift, placed.flat)
        return np.r_[shift * weight, residuals.ravel() / LIGHT_DEVIATION]

    return least_squares(residual, np.zeros(3))


def residual_of(press: Object, leds: F8, shift: F8, flat: bool) -> F8:
    """Light minus model, K x N; zero where an LED does not reach."""
    return _residual(press, *press.moved(shift), leds, flat)


def _distant(objects: list[Object], k: int, width_mm: float, flat: bool) -> F8:
    """A distant LED by linear least squares, then moved to a distance of a few image widths."""
    normal = np.hstack([o.moved(np.zeros(3))[0][:, o.lit[k]] for o in objects])
    light = np.concatenate([o.light[k, o.lit[k]] for o in objects])
    if objects[0].beneath is not None:
        gain = 1.0
        below = np.hstack([o.beneath[0][:, o.lit[k]] for o in objects if o.beneath is not None])
        residual = normal - light * below
        a, *_ = np.linalg.lstsq(residual[:2].T, -residual[2], rcond=None)
    elif flat:
        gain, a = 1.0, slants_of(normal, light)
    else:
        a, *_ = np.linalg.lstsq(normal.T, light, rcond=None)
        gain = max(float(a[2]), 0.1)
        a = a[:2] / gain
    return np.array([*a, 0.2 / width_mm, np.log(gain)])


def slants_of(normal: F8, light: F8) -> F8:
    """Return L_x / L_z and L_y / L_z of a distant LED, by linear least squares."""
    return np.asarray(np.linalg.lstsq(normal[:2].T, light - normal[2], rcond=None)[0])


def _over(beneath: tuple[F8, F8, F8, F8], a: F8, b: F8, c: F8) -> F8:
    """The irradiance of the film at rest by LEDs, in units of L_z."""
    (nx, ny, nz), x, y, z = beneath
    dx, dy, dz = a - c * x, b - c * y, 1 - c * z
    return np.asarray((nx * dx + ny * dy + nz * dz) * (dx * dx + dy * dy + dz * dz) ** -1.5)


def _residual(press: Object, normal: F8, z: F8, leds: F8, flat: bool) -> F8:
    """Light minus model, in units of L_z, which stay finite for a distant LED."""
    (nx, ny, nz), (a, b, c, log_strength) = normal, leds.T[..., None]
    dx, dy, dz = a - c * press.x, b - c * press.y, 1 - c * z
    plan = dx * dx + dy * dy
    at_rest = plan + 1 if flat else (a * a + b * b + 1) * np.exp(log_strength / 1.5)
    model = (nx * dx + ny * dy + nz * dz) * irradiance_ratio(at_rest, plan + dz * dz)
    if flat and press.beneath is not None:
        model /= irradiance_ratio(at_rest, 1.0) * np.maximum(
            _over(press.beneath, a, b, c), MIN_OVER
        )
    return np.where(press.lit & (model > DIM_LIGHT), press.light - model, 0)


def _rest_residual(rest: Rest | None, leds: F8) -> list[F8]:
    """Logarithm of the flat frame minus the model's, without the shared gain."""
    if rest is None:
        return []
    a, b, c, log_strength = leds.T[..., None]
    model = log_strength - 1.5 * np.log((a - c * rest.x) ** 2 + (b - c * rest.y) ** 2 + 1)
    if rest.beneath is not None:
        model = log_strength + np.log(np.maximum(_over(rest.beneath, a, b, c), MIN_OVER))
    # The mean of a block is `block` times less noisy than a pixel.
    residual = (rest.logarithm - (model - model.mean(axis=0))) * rest.block
    # The strengths' common factor is free: hold their mean.
    return [residual.ravel() / LIGHT_DEVIATION, leds[:, 3].mean(keepdims=True) / LIGHT_DEVIATION]
