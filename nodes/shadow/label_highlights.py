"""Find where one LED is mirrored by the film, and leave its light out."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray

from tactograph.graph import Flips, SizeLimit, node
from tactograph.nodes import F4, Height, Labels, Light, LightPositions, PixelSize
from tactograph.nodes.light._cache_blocks import in_blocks
from tactograph.nodes.light._near_light import F8, expected_light, light_vectors, places, vectors_at

FEWEST = 3
"""LEDs that have to remain: two would leave two normals."""
UNKNOWN = np.float32(1e3)
"""Standard deviation of a light that says nothing."""
SOFTLY = np.float32(1e-6)


class Highlights(NamedTuple):
    """The LEDs that are mirrored, and the deviations with which their light counts no more."""

    highlight: Labels
    sigma: Light


class _Moments(NamedTuple):
    """A symmetric 3 x 3 matrix per pixel, taken apart into L D L^T: one over D, then L."""

    first: F4
    second: F4
    third: F4
    yx: F4
    zx: F4
    zy: F4

    def solve(self, right: F4 | F8) -> F4:
        """The inverse times 3 x N."""
        y = right[1] - self.yx * right[0]
        z = (right[2] - self.zx * right[0] - self.zy * y) * self.third
        y = y * self.second - self.zy * z
        x = right[0] * self.first - self.yx * y - self.zx * z
        return np.asarray([x, y, z], np.float32)


class _Fit(NamedTuple):
    """Unit normals 3 x N, the matrix of their equations, and the chi-square that they leave."""

    normal: F4
    moments: _Moments
    misfit: F4


@node(
    sizes={"K": SizeLimit(3, 8, "two LEDs leave two slopes, a label has 8 bits")},
    tolerance=Flips(2e-3, why="thresholds on chi-squares, of sums in float32"),
)
def label_highlights(
    light: Light,
    sigma: Light,
    lights: LightPositions,
    height: Height,
    pixel: PixelSize,
    *,
    unlikely: Annotated[float, Gt(0)] = 25.0,
    likely: Annotated[float, Gt(0)] = 12.0,
    excess: Annotated[float, Gt(0)] = 4.0,
    lobe_deg: Annotated[float, Interval(gt=0, le=90)] = 20.0,
) -> Highlights:
    """Mark the LED whose light exceeds what the others allow, where it could be mirrored.

    The idea is Barsky and Petrou's ("The 4-source photometric stereo technique for
    three-dimensional surfaces in the presence of highlights and shadows", 2003): with four
    LEDs any three tell what the fourth should give.  Where all of them together fit no unit
    normal (`_near_light`, N1), each is left out in turn.  The one without which the others
    fit best is a highlight if they fit well, it is brighter than they predict, and their
    normal lies near the direction half-way between LED and camera.  Where it is darker it is
    a shadow, which is `label_lights`' to find.  With three LEDs nothing is marked.

    Parameters
    ----------
    light, sigma
        K x H x W, relative to the film at rest, and its standard deviation.
    lights
        K x 3 in mm from the middle of the image.
    height
        H x W in mm, as far as known.
    pixel
        mm per px.
    unlikely
        Chi-square of all LEDs together above which one of them is doubted.
    likely
        Chi-square of the others below which they agree.
    excess
        By how many standard deviations a highlight is brighter than predicted.
    lobe_deg
        Largest angle between the normal and the half-way direction.

    Returns
    -------
    Highlights
        H x W, bit k-1 where LED k is mirrored; K x H x W, `sigma`, but 1000 there, so that
        `label_lights` leaves that light out without calling it a shadow.
    """
    count, size = len(light), height.size
    marked = np.zeros(size, np.uint8)
    x, y = (np.broadcast_to(part, height.shape).ravel() for part in _places(height, pixel))
    seen, noise, z = light.reshape(count, size), sigma.reshape(count, size), height.ravel()
    near = np.cos(np.deg2rad(np.float32(lobe_deg)))

    def mark(part: slice) -> None:
        together = _fit(
            seen[:, part], noise[:, part], vectors_at(lights, x[part], y[part], z[part])
        )
        at = np.flatnonzero(together.misfit > np.float32(unlikely)) + part.start
        spot = np.stack([x[at], y[at], z[at]])
        towards, halves = vectors_at(lights, *spot), _half_way(lights, spot)
        marked[at] = _mirrored(seen[:, at], noise[:, at], towards, halves, likely, excess, near)

    if count > FEWEST:
        in_blocks(mark, size)
    highlight = marked.reshape(height.shape)
    numbers = np.arange(count, dtype=np.uint8)[:, None, None]
    raised = np.where(highlight >> numbers & 1, UNKNOWN, sigma)
    return Highlights(highlight, np.asarray(raised, np.float32))


label_highlights.opencl(grid="H W", lanes="grid")


def _fit(light: F4, sigma: F4, vectors: F4) -> _Fit:
    """Least squares, then the nearest normal of unit length in the metric of the noise."""
    weight = np.float32(1) / np.maximum(sigma * sigma, np.float32(1e-10))
    moments = _moments(weight, vectors)
    free = moments.solve(((weight * light)[:, None] * vectors).sum(axis=0))
    length = np.sqrt(_dot(free, free))
    unit = free / np.maximum(length, np.float32(1e-6))
    along = moments.solve(unit)
    spread = np.maximum(_dot(unit, along), np.float32(1e-12))
    nearest = free - along * ((length - np.float32(1)) / spread)
    length = np.maximum(np.sqrt(_dot(nearest, nearest)), np.float32(1e-6))
    normal = np.asarray(nearest / length, np.float32)
    away = light - _dot(vectors.swapaxes(0, 1), normal)
    return _Fit(normal, moments, np.asarray((weight * away * away).sum(axis=0), np.float32))


def _moments(weight: F4, vectors: F4) -> _Moments:
    """The sum of weight v v^T, softened, with pivots that stay above zero."""
    x, y, z = vectors.swapaxes(0, 1)
    xx, xy, xz, yy, yz, zz = (
        (weight * a * b).sum(axis=0) for a, b in ((x, x), (x, y), (x, z), (y, y), (y, z), (z, z))
    )
    soft = np.maximum(SOFTLY * (xx + yy + zz), np.float32(1e-20))
    one = np.float32(1)
    first = one / (xx + soft)
    yx, zx = xy * first, xz * first
    second = one / np.maximum(yy + soft - yx * xy, soft)
    zy = (yz - yx * xz) * second
    third = one / np.maximum(zz + soft - zx * xz - zy * (yz - yx * xz), soft)
    return _Moments(first, second, third, yx, zx, zy)


def _dot(a: F4 | F8, b: F4 | F8) -> F4:
    """The product of vectors whose x, y and z come first."""
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2], np.float32)


def _places(height: Height, pixel: float) -> tuple[F4, F4]:
    """The x and y of the columns and rows, 1 x W and H x 1."""
    rows, columns = (places(size, np.float32(pixel)) for size in height.shape)
    return columns[None, :], rows[:, None]


def _half_way(lights: LightPositions, spot: F4) -> F4:
    """Unit vectors half-way between each LED and the camera above places of 3 x N: K x 3 x N."""
    ray = lights[:, :, None] - spot
    half = ray / np.sqrt(_dot(ray.swapaxes(0, 1), ray.swapaxes(0, 1)))[:, None]
    half[:, 2] += 1
    parts = half.swapaxes(0, 1)
    return np.asarray(half / np.sqrt(_dot(parts, parts))[:, None], np.float32)


def _mirrored(
    light: F4, sigma: F4, vectors: F4, halves: F4, likely: float, excess: float, near: np.float32
) -> NDArray[np.uint8]:
    """The bit of the LED, if any, that is brighter than the others allow: N."""
    count, size = light.shape
    best = np.full(size, np.inf, np.float32)
    marked = np.zeros(size, np.uint8)
    for k in range(count):
        others = [j for j in range(count) if j != k]
        fit = _fit(light[others], sigma[others], vectors[others])
        over = light[k] - _dot(vectors[k], fit.normal)
        doubt = _dot(vectors[k], fit.moments.solve(vectors[k]))
        bright = over > np.float32(excess) * np.sqrt(sigma[k] * sigma[k] + doubt)
        facing = _dot(halves[k], fit.normal) > near
        better = fit.misfit < best
        best = np.where(better, fit.misfit, best)
        found = bright & facing & (fit.misfit < np.float32(likely))
        marked = np.where(better, np.where(found, np.uint8(1 << k), np.uint8(0)), marked)
    return marked


@label_highlights.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """A film in slopes of all kinds under LEDs around it, some of it mirroring or in shadow."""
    azimuth = (np.arange(K) + rng.uniform(-0.2, 0.2, K)) * 2 * np.pi / K
    reach, z = rng.uniform(20, 40, K), rng.uniform(30, 60, K)
    places_mm = np.column_stack([reach * np.cos(azimuth), reach * np.sin(azimuth), z])
    lights = np.asarray(places_mm, np.float32)
    height = rng.uniform(0, 1, (H, W)).astype(np.float32)
    slope = rng.uniform(-1, 1, (2, H, W)).astype(np.float32)
    light = expected_light(light_vectors(lights, height, 0.1), slope)
    light += rng.normal(0, 0.01, light.shape) + (rng.random(light.shape) < 0.1)
    light *= rng.random(light.shape) < 0.9
    return {
        "light": light.astype(np.float32),
        "sigma": np.full_like(light, 0.01),
        "lights": lights,
        "height": height,
        "pixel": 0.1,
    }
