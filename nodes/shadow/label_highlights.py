"""Find where one LED is mirrored by the film, and leave its light out."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Gt, Interval
from numpy.typing import NDArray

from tactograph.graph import SizeLimit, node
from tactograph.nodes import F4, Height, Labels, Light, LightPositions, PixelSize
from tactograph.nodes.light._near_light import light_vectors, places

FEWEST = 3
"""LEDs that have to remain: two would leave two normals."""
UNKNOWN = np.float32(1e3)
"""Standard deviation of a light that says nothing."""
SOFTLY = np.float32(1e-6)


class Highlights(NamedTuple):
    """The LEDs that are mirrored, and the deviations with which their light counts no more."""

    highlight: Labels
    sigma: Light


class _Fit(NamedTuple):
    """Unit normals 3 x N, their covariance N x 3 x 3, and the chi-square that they leave."""

    normal: F4
    covariance: F4
    misfit: F4


@node(sizes={"K": SizeLimit(3, 8, "two LEDs leave two slopes, a label has 8 bits")})
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
    count = len(light)
    marked = np.zeros(height.shape, np.uint8)
    if count > FEWEST:
        vectors = light_vectors(lights, height, pixel)
        together = _fit(*(part.reshape(*part.shape[:-2], -1) for part in (light, sigma, vectors)))
        doubted = (together.misfit > np.float32(unlikely)).reshape(height.shape)
        row, column = np.nonzero(doubted)
        halves = _half_way(lights, height, pixel, row, column)
        near = np.float32(np.cos(np.deg2rad(lobe_deg)))
        seen, noise, towards = (part[..., row, column] for part in (light, sigma, vectors))
        marked[row, column] = _mirrored(seen, noise, towards, halves, likely, excess, near)
    numbers = np.arange(count, dtype=np.uint8)[:, None, None]
    return Highlights(marked, np.where(marked >> numbers & 1, UNKNOWN, sigma).astype(np.float32))


def _fit(light: F4, sigma: F4, vectors: F4) -> _Fit:
    """Least squares, then the nearest normal of unit length in the metric of the noise."""
    weight = np.float32(1) / np.maximum(sigma * sigma, np.float32(1e-10))
    weighted = (weight[:, None] * vectors).transpose(2, 1, 0)
    matrix = weighted @ vectors.transpose(2, 0, 1)
    trace = np.trace(matrix, axis1=1, axis2=2)[:, None, None]
    covariance = np.linalg.inv(matrix + SOFTLY * trace * np.eye(3, dtype=np.float32))
    free = (covariance @ (weighted @ light.T[..., None]))[..., 0].T
    length = np.sqrt((free * free).sum(axis=0))
    unit = free / np.maximum(length, np.float32(1e-6))
    along = np.einsum("nij,jn->in", covariance, unit)
    spread = np.maximum((unit * along).sum(axis=0), np.float32(1e-12))
    over = length - np.float32(1)
    normal = free - along * (over / spread)
    normal = normal / np.maximum(np.sqrt((normal * normal).sum(axis=0)), np.float32(1e-6))
    away = light - (vectors * normal).sum(axis=1)
    return _Fit(normal, covariance, np.asarray((weight * away * away).sum(axis=0), np.float32))


def _half_way(
    lights: LightPositions,
    height: Height,
    pixel: float,
    row: NDArray[np.intp],
    column: NDArray[np.intp],
) -> F4:
    """Unit vectors half-way between each LED and the camera above, K x 3 x N."""
    rows, columns = (places(size, np.float32(pixel)) for size in height.shape)
    spot = np.stack([columns[column], rows[row], height[row, column]])
    ray = lights[:, :, None] - spot
    half = ray / np.sqrt((ray * ray).sum(axis=1, keepdims=True))
    half[:, 2] += 1
    return np.asarray(half / np.sqrt((half * half).sum(axis=1, keepdims=True)), np.float32)


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
        over = light[k] - (vectors[k] * fit.normal).sum(axis=0)
        doubt = np.einsum("in,nij,jn->n", vectors[k], fit.covariance, vectors[k])
        bright = over > np.float32(excess) * np.sqrt(sigma[k] * sigma[k] + doubt)
        facing = (halves[k] * fit.normal).sum(axis=0) > near
        better = fit.misfit < best
        best = np.where(better, fit.misfit, best)
        found = bright & facing & (fit.misfit < np.float32(likely))
        marked = np.where(better, np.where(found, np.uint8(1 << k), np.uint8(0)), marked)
    return marked
