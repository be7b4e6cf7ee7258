"""Adapt a reflectance map to a new film by a check press."""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray

from tactograph.rings.oneshot.nodes.map.reflectance_map import (
    PLACE_DEGREE,
    SHADE_COUNT,
    ReflectanceMap,
    robust_weights,
)
from tactograph.rings.oneshot.nodes.presses import Circles, PressImages
from tactograph.rings.oneshot.nodes.presses.fit_reflectance_map import FIT_ROUNDS, RIM_ROUNDS, Bench
from tactograph.rings.recheck.nodes import MAX_INDEPENDENT
from tactograph.sdk import F8, Light, Odds, PixelSize, node

MAX_PRESS_PIXELS = 1500
"""Most pixels of a press that are fitted."""
HEIGHT_SHADE = SHADE_COUNT - 1
PRIOR_DEVIATIONS = {"gain": 0.1, "shades": 0.3, "offsets": 0.05}
"""Prior standard deviations: of a gain; of single harmonics' gains; of offsets to harmonics."""
MAP_DEVIATION = 0.01
"""Standard deviation of the light from the map."""
MAP_CHANGES = (("gain",), ("gain", "shades"), ("gain", "shades", "offsets"))
"""The changes tried, the simplest first."""


class MapRefit(NamedTuple):
    """The new map, and figures."""

    reflectance: ReflectanceMap
    quality: dict[str, float]


@node
def refit_reflectance_map(
    image: PressImages,
    flat: Light,
    names: list[str],
    circle: Circles,
    reflectance: ReflectanceMap,
    pixel: PixelSize,
    *,
    radius_mm: Annotated[float, Gt(0)] | None = None,
) -> MapRefit:
    """Return the map of a new film: the old one, with the changes that a check press shows.

    The variation of equation M1's coefficients over the film comes from the LED positions,
    which stay the same.  A check press may change, per light: a gain of all harmonics and one
    of the height; a gain of each harmonic; an offset to each harmonic.  Robust least squares
    fits them with priors of no change, in this order.  A further change is accepted if it lowers
    the error of the normals on held-out quarters of the press by more than a standard error
    (`Odds.pays`).

    Parameters
    ----------
    image, flat : P x K x H x W check presses and the K x H x W new film at rest
    names
        The presses' names.  No names mean that there is no check press, and the map stays.
    circle : P x 3 in px, as `find_presses` returns it; presses of radius 0 are left out
    reflectance : K x 9 x 15, of the old film
    pixel : mm per px
    radius_mm : the ball's radius

    Returns
    -------
    Coefficients K x 9 x 15; ``check_deg/before`` and ``check_deg/held_out``, the mean angle between
    normals on the check press with the old and the new map; ``check_um``, the error of the height
    there; ``gain_percent/...`` of each light.
    """
    is_used = circle[:, 2] > 0
    if not names or radius_mm is None or not is_used.any():
        return MapRefit(reflectance, {})
    bench = Bench.of(image[is_used], flat, radius_mm, pixel, PLACE_DEGREE)
    old = reflectance.astype(np.float64)
    check = _Check(bench, old, circle[is_used].astype(np.float64))
    best, before, microns = check.held_out(())
    errors = before
    for parts in MAP_CHANGES:
        candidates, degrees, height = check.held_out(parts)
        if Odds().pays(errors, degrees):
            best, errors, microns = candidates, degrees, height
    now, then = best[:, :HEIGHT_SHADE], old[:, :HEIGHT_SHADE]
    gains = (now * then).sum((1, 2)) / np.square(then).sum((1, 2))
    figures = {"check_deg/before": float(np.mean(before)), "check_um": microns}
    figures["check_deg/held_out"] = float(np.mean(errors))
    figures |= {f"gain_percent/light{k}": 100 * float(g) for k, g in enumerate(gains, start=1)}
    return MapRefit(best.astype(np.float32), figures)


class _Check(NamedTuple):
    """Check presses, the old map, and the presses' circles."""

    bench: Bench
    old: F8
    circles: F8

    def held_out(self, parts: tuple[str, ...]) -> tuple[F8, list[float], float]:
        """The map fitted to all quarters, each held-out error in degrees, and their mean in um."""
        y, x = np.indices(self.bench.shape)
        # The quarter of its ball that holds out each pixel of each press, P x H x W.
        right, low = ([at > c[axis] for c in self.circles] for axis, at in enumerate((x, y)))
        number = np.where(low, np.logical_not(right), 2 + np.asarray(right))
        whole, _ = self._fit(parts, number >= 0)
        degrees, microns = [], []
        for fold in np.unique(number):
            refitted, placed = self._fit(parts, number != fold)
            for press, circle in enumerate(placed):
                slope, height = self.bench.reconstruct(refitted, press)
                ball = self.bench.ball(circle)
                off, um, _ = ball.errors(slope, height, number[press] == fold)
                degrees.append(off)
                microns.append(um)
        return whole, degrees, float(np.mean(microns))

    def _fit(self, parts: tuple[str, ...], used: NDArray[np.bool_]) -> tuple[F8, F8]:
        """Update centres, the rim's height and map in turn; return map and circles."""
        bench, placed, reflectance = self.bench, self.circles.copy(), self.old
        every, rim = np.ones(len(placed), bool), 0.0
        for _ in range(RIM_ROUNDS + 1):
            for press, circle in enumerate(placed):
                placed[press] = bench.refine_center(reflectance, circle, press, rim)
            rim = bench.measure_rim(reflectance, placed, every)
            if parts:
                reflectance = self._refitted(placed, rim, parts, used)
        return reflectance, placed

    def _refitted(
        self, circles: F8, rim: float, parts: tuple[str, ...], used: NDArray[np.bool_]
    ) -> F8:
        """The old map with the changes fitted to the used pixels."""
        samples: list[tuple[F8, ...]] = []
        for press, circle in enumerate(circles):
            pixels = self.bench.pixels(press, circle, MAX_PRESS_PIXELS)
            chosen = used[press][pixels.y.astype(int), pixels.x.astype(int)]
            shade = self.bench.shades(circle, pixels, rim)
            of_press = shade, pixels.place, pixels.light, pixels.weight
            samples.append(tuple(part[:, chosen] for part in of_press))
        shade, place, light, weight = (
            np.concatenate(part, axis=-1) for part in zip(*samples, strict=True)
        )
        lights = zip(self.old, light, weight, strict=True)
        return np.stack([_of_one(c, shade, place, one, even, parts) for c, one, even in lights])


def _of_one(c: F8, shade: F8, place: F8, light: F8, even: F8, parts: tuple[str, ...]) -> F8:
    """The coefficients of one light, 9 x 15, after robust ridge regression of the changes."""
    shared = (c @ place) * shade
    columns: dict[str, F8] = {
        "gain": np.stack([shared[:HEIGHT_SHADE].sum(0), shared[HEIGHT_SHADE]]),
        "shades": shared[:HEIGHT_SHADE],
        "offsets": shade[:HEIGHT_SHADE],
    }
    basis, residual = np.concatenate([columns[part] for part in parts]), light - shared.sum(0)
    ridge = np.concatenate([[PRIOR_DEVIATIONS[part]] * len(columns[part]) for part in parts])
    thinned = min(1.0, MAX_INDEPENDENT / max(light.size, 1))
    weight, change = even / even.mean(), np.zeros(len(basis))
    for _ in range(FIT_ROUNDS):
        weighted = basis * (weight * thinned / MAP_DEVIATION**2)
        normal = weighted @ basis.T + np.diag(ridge**-2)
        change = np.linalg.solve(normal, weighted @ residual)
        weight = robust_weights(residual - change @ basis, even / even.mean())
    new = c.copy()
    new[:HEIGHT_SHADE] *= 1 + change[0]
    new[HEIGHT_SHADE] *= 1 + change[1]
    if "shades" in parts:
        new[:HEIGHT_SHADE] += c[:HEIGHT_SHADE] * change[2 : 2 + HEIGHT_SHADE, None]
    if "offsets" in parts:
        new[:HEIGHT_SHADE, 0] += change[-HEIGHT_SHADE:]
    return new
