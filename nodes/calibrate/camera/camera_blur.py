"""Measure the camera's blur on the rims of pressed balls.

Long because edges have to be found, chosen and fitted.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from tactograph.graph import node
from tactograph.nodes import F8, Blur, Film, Light, Metrics, Noise, PixelSize
from tactograph.nodes.calibrate import MIN_FLAT_LIGHT, BallCircles, BallPress
from tactograph.nodes.calibrate.camera._ball_ring import BallRing
from tactograph.nodes.calibrate.camera._fold_light import Folds, folds, tells_folds
from tactograph.nodes.optics.sheet import SheetLight, cut

MAX_BALLS = 8
"""Largest number of balls to use, spread over all."""
INNER_RADII, OUTER_RADII = 0.8, 1.35
"""Range in which a rim is searched for, in radii of the ball's circle."""
REACH_PX = 6
"""Width of the film on either side of an edge to which its light is fitted."""
FOLD_REACH_PX = 2 * REACH_PX
"""Width of the film on either side of a fold in whose light a blur is searched for."""
STEP_PX = 3
"""Width on either side of an edge over which its strength is measured."""
MIN_STEP = 0.15
"""Smallest strength of an edge, relative to the light of the film at rest."""
MAX_EDGES, MIN_EDGES = 200, 8
"""Largest number of edges to fit, the strongest; and smallest number for an estimate."""
SHARP_SHARE = 0.25
"""Share of edges that are sharp; others are bent film, or shadows that cross a sector."""
WIDTHS_PX = np.geomspace(0.2, 3, 25)
SHIFTS_PX = np.arange(-3, 3.01, 0.25)
"""Widths and places of an edge to try."""
COARSE_STEP = 4
"""Stride of the widths in the first, coarse search."""
PIXEL_VARIANCE = 1 / 12
"""Variance in px^2 of the places within a pixel."""
MIN_BLUR_PX = 0.15
"""Smallest blur distinguishable from the width of a pixel."""


class Edge(NamedTuple):
    """Strength of an edge, and the light around it by distance from its place."""

    step: float
    away: F8
    light: F8


class CameraBlur(NamedTuple):
    """The blur, and its figure for people."""

    blur: Blur
    quality: Metrics


@node
def camera_blur(
    image: SheetLight,
    flat: Light,
    circle: BallCircles,
    of: BallPress,
    pixel: PixelSize,
    binned: PixelSize,
    film: Film | None = None,
    noise: Noise | None = None,
) -> CameraBlur:
    """Return the standard deviation of the camera's point spread, beyond the pixel itself.

    Where film leaves a ball its light changes abruptly, and the camera spreads that edge.  Edges
    are searched for around each ball by sector and LED, and a step blurred by a Gaussian is fitted
    to each (the edge spread of ISO 12233, with the edge's slant given by the circle).  Film bends,
    so only the sharpest edges count: the result is the lower quartile of the widths, minus the
    pixel's width.  Blur by resampling for a lens is included.

    A film that bends gently at all rims looks like a blur to edges, but a blur would make it darker
    there (`_fold_light`): on film that is plain and throws no light on itself, the blur is at most
    what the brightness of the folds allows.

    Parameters
    ----------
    image : K x S x W, as captured, the presses on a sheet
    flat : K x H x W, the film at rest
    circle, of
        x, y and contact radius of each ball in `binned` pixels, and its press; a ball that was not
        found has the radius 0.
    pixel, binned : mm per px of the image, and of `circle`
    film, noise : what was fitted to the presses, and (shot, read); without them edges alone tell

    Returns
    -------
    In px; 0 if rims are too few or too faint, or as sharp as a pixel.
    """
    scale = np.float32(binned / pixel)
    used = np.flatnonzero(circle[:, 2] > 0)
    presses, edges, bent = cut(image, flat.shape[1]), list[Edge](), list[Folds]()
    plain = film if film is not None and tells_folds(film) else None
    for ball in used[:: -(-used.size // MAX_BALLS) or 1]:
        x, y, radius = circle[ball] * scale
        middle = float(x + (scale - 1) / 2), float(y + (scale - 1) / 2)
        edges += _edges(presses[of[ball]], flat, middle, float(radius))
        if plain is not None and noise is not None:
            first, last = INNER_RADII * radius - FOLD_REACH_PX, OUTER_RADII * radius + FOLD_REACH_PX
            ring = BallRing.of(flat.shape[1:], middle, float(first), float(last))
            bent.append(folds(presses[of[ball]], flat, ring, FOLD_REACH_PX, plain, noise, pixel))
    edges = sorted(edges, key=lambda edge: -edge.step)[:MAX_EDGES]
    blur = 0.0
    if len(edges) >= MIN_EDGES:
        width = float(np.quantile([_width(edge) for edge in edges], SHARP_SHARE))
        wider = float(np.sqrt(max(width * width - PIXEL_VARIANCE, 0)))
        if plain is not None and bent:
            wider = min(wider, Folds(*np.concatenate(bent, axis=1)).most_blur(plain.uneven))
        blur = wider if wider >= MIN_BLUR_PX else 0.0
    return CameraBlur(blur, {"camera_blur_px": blur})


def _edges(image: Light, flat: Light, middle: tuple[float, float], radius: float) -> list[Edge]:
    """The strongest edge in each sector around a ball, under each LED."""
    first, last = INNER_RADII * radius - REACH_PX, OUTER_RADII * radius + REACH_PX
    ring = BallRing.of(image.shape[1:], middle, first, last)
    whole, edges = np.flatnonzero((ring.counts > 0).all(axis=1)), []
    for plane, rest in zip(image, flat, strict=True):
        light = plane[ring.inside] / np.maximum(rest[ring.inside], MIN_FLAT_LIGHT)
        profiles = ring.mean(light.astype(np.float64))
        for number in whole:
            step, at = _strongest_step(profiles[number])
            away = ring.distance - at
            near = (ring.sector == number) & (np.abs(away) < REACH_PX)
            if step > MIN_STEP:
                edges.append(Edge(step, away[near], light[near].astype(np.float64)))
    return edges


def _strongest_step(profile: F8) -> tuple[float, float]:
    """Strength and place in px of the largest change along a profile, off its ends."""
    sums = np.concatenate([[0.0], np.cumsum(profile)])
    at = np.arange(REACH_PX, profile.size - REACH_PX)
    steps = np.abs(sums[at + STEP_PX] - 2 * sums[at] + sums[at - STEP_PX]) / STEP_PX
    best = int(np.argmax(steps))
    return float(steps[best]), float(at[best])


def _width(edge: Edge) -> float:
    """Standard deviation in px of the step that fits the light best, with a slope on each side.

    A coarse set of widths is tried first, then those around the best.
    """
    residual = {width: _residual(edge, width) for width in WIDTHS_PX[::COARSE_STEP]}
    best = int(np.searchsorted(WIDTHS_PX, min(residual, key=residual.__getitem__)))
    near = WIDTHS_PX[max(best - COARSE_STEP + 1, 0) : best + COARSE_STEP]
    residual |= {width: _residual(edge, width) for width in near if width not in residual}
    return float(min(residual, key=residual.__getitem__))


def _residual(edge: Edge, width: float) -> float:
    """The residual sum of squares of a step of this width at its best place."""
    x = edge.away[None] - SHIFTS_PX[:, None]
    beyond: NDArray[np.float64] = ndtr(x / width)
    columns = np.stack([1 - beyond, beyond, x * (1 - beyond), x * beyond], axis=1)
    normal = columns @ columns.swapaxes(-1, -2) + 1e-9 * np.eye(4)
    projection = (columns.reshape(-1, edge.light.size) @ edge.light).reshape(-1, 4)
    solved = np.linalg.solve(normal, projection[..., None])[..., 0]
    return float((edge.light @ edge.light - (projection * solved).sum(axis=-1)).min())
