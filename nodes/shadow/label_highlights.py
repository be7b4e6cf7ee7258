"""Find pixels where the film mirrors an LED, and exclude that light."""

from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Gt, Interval

from tactograph.graph import Close, SizeLimit, node
from tactograph.nodes import F8, Height, Labels, Light, LightPositions, PixelSize
from tactograph.nodes.optics.cache_blocks import in_blocks
from tactograph.nodes.optics.near_light import lights_around, matt_film_light, places, vectors_at
from tactograph.nodes.optics.normals import cofactors, dot, times

MIN_OTHER_LEDS = 3
"""Number of LEDs that must remain, since two LEDs allow two normals."""
RIDGE_TRACE_SHARE = 1e-6
"""Share of the trace added to the diagonal, so that nearly parallel lights remain solvable."""
UNUSED_SIGMA = np.float32(1e3)
"""Standard deviation of a light that carries no information."""
LEVEL_NORMAL = np.array([[0], [0], [1]])


class Highlights(NamedTuple):
    """The labels of mirrored LEDs, and standard deviations that exclude their light."""

    highlight: Labels
    sigma: Light


@node(
    sizes={"K": SizeLimit(3, 8, "two LEDs leave two slopes, a label has 8 bits")},
    tolerance=Close(share=2e-3, why="thresholds on chi-squares from float32 sums"),
)
def label_highlights(
    light: Light,
    sigma: Light,
    lights: LightPositions,
    height: Height,
    pixel: PixelSize,
    *,
    doubt_chi2: Annotated[float, Gt(0)] = 25.0,
    fit_chi2: Annotated[float, Gt(0)] = 12.0,
    excess: Annotated[float, Gt(0)] = 4.0,
    lobe_deg: Annotated[float, Interval(gt=0, le=90)] = 20.0,
) -> Highlights:
    """Mark the LED whose light exceeds the prediction of the others, where it could be mirrored.

    The idea is from S. Barsky and M. Petrou, "The 4-source photometric stereo technique for
    three-dimensional surfaces in the presence of highlights and shadows", IEEE PAMI 25(10), 2003:
    with four LEDs any three predict the fourth.  Where no unit normal fits all of them
    (`near_light`, N1), each LED is left out in turn, and the LED without which the others fit best
    is suspected.  It is a highlight if the others fit well, if it is brighter than they predict,
    and if their normal is close to the direction half-way between LED and camera.  A darker LED is
    shadowed, and `label_lights` finds it.  With three LEDs nothing is marked.

    Parameters
    ----------
    light, sigma : K x H x W, relative to the film at rest, and its standard deviation
    lights : K x 3 in mm from the middle of the image
    height : H x W in mm, as far as known
    pixel : mm per px
    doubt_chi2 : chi-square of all LEDs above which one of them is suspected
    fit_chi2 : chi-square of the others below which they fit well
    excess : standard deviations by which a highlight must exceed the prediction
    lobe_deg : largest angle between the normal and the half-way direction

    Returns
    -------
    H x W, bit k-1 set where LED k is mirrored; K x H x W, `sigma`, raised to 1000 there, so that
    `label_lights` ignores that light without labelling it a shadow.
    """
    x, y = (places(size, np.float32(pixel)) for size in height.shape[::-1])
    near = np.cos(np.deg2rad(np.float32(lobe_deg)))
    highlight = np.zeros(height.shape, np.uint8)

    def mark(rows: slice) -> None:
        v = vectors_at(lights, x, y[rows, None], height[rows]).swapaxes(0, 1)
        m, weight = light[:, rows], 1 / np.maximum(np.square(sigma[:, rows]), 1e-10)
        # Test level film first: if it explains the light, so does the best normal.
        where = (weight * np.square(m - v[2])).sum(axis=0) > doubt_chi2
        # Double precision, because lights may be nearly parallel.
        parts: Any = (np.ascontiguousarray(part[..., where], np.float64) for part in (v, m, weight))
        v, m, weight = parts
        marked, least = np.zeros(m.shape[1], np.uint8), np.full(m.shape[1], np.inf)
        for k, towards in enumerate(v.swapaxes(0, 1)):
            others = weight.copy()
            others[k] = 0
            normal, covariance, misfit = _fit(v, m, others)
            predicted = dot(towards, times(covariance, towards))
            bright = m[k] - dot(towards, normal) > excess * np.sqrt(1 / weight[k] + predicted)
            half_way = towards / np.linalg.norm(towards, axis=0) + LEVEL_NORMAL
            facing = dot(half_way, normal) > near * np.linalg.norm(half_way, axis=0)
            is_highlight = bright & facing & (misfit < fit_chi2)
            marked = np.where(misfit < least, is_highlight * np.uint8(1 << k), marked)
            least = np.minimum(misfit, least)
        is_doubted = _fit(v, m, weight)[2] > doubt_chi2
        highlight[rows][where] = np.where(is_doubted, marked, np.uint8(0))

    if len(light) > MIN_OTHER_LEDS:
        in_blocks(mark, y.size, light[:, 0].size)
    bits = highlight >> np.arange(len(light), dtype=np.uint8)[:, None, None] & 1
    return Highlights(highlight, np.where(bits, UNUSED_SIGMA, sigma))


label_highlights.opencl(grid="H W", lanes="grid")


@label_highlights.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """Random slopes under LEDs around the film, with scattered highlights and shadows."""
    lights = lights_around(rng, K)
    height = rng.uniform(0, 1, (H, W)).astype(np.float32)
    slope = rng.uniform(-1, 1, (2, H, W)).astype(np.float32)
    light = matt_film_light(lights, height, slope, 0.1)
    light += rng.normal(0, 0.01, light.shape) + (rng.random(light.shape) < 0.1)
    light *= rng.random(light.shape) < 0.9
    sigma = np.full_like(light, 0.01)
    return {"light": light, "sigma": sigma, "lights": lights, "height": height, "pixel": 0.1}


def _fit(v: F8, light: F8, weight: F8) -> tuple[F8, F8, F8]:
    """Solve for the normal by least squares; then find the nearest unit normal, weighted by noise.

    Returns for N pixels the unit normals (3 x N), the covariances of the least squares
    (3 x 3 x N), and the chi-squares.
    """
    moments = np.einsum("ikn,kn,jkn->ijn", v, weight, v)
    moments += RIDGE_TRACE_SHARE * np.eye(3)[..., None] * np.trace(moments)
    covariance = cofactors(moments)
    covariance /= dot(moments[0], covariance[0])
    free = times(covariance, np.einsum("ikn,kn,kn->in", v, weight, light))
    length = np.linalg.norm(free, axis=0)
    unit = free / np.maximum(length, 1e-6)
    along = times(covariance, unit)
    normal = free - along * (length - 1) / np.maximum(dot(unit, along), 1e-12)
    normal /= np.maximum(np.linalg.norm(normal, axis=0), 1e-6)
    return normal, covariance, (weight * np.square(light - dot(v, normal))).sum(axis=0)
