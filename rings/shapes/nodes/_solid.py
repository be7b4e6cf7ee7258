"""Smooth solids as signed distance functions, and their height seen from above.

A solid maps points to their distance from its surface, negative inside.  Distances may be
underestimated but hardly overestimated, because `relief` walks towards the surface by them.
"""

import itertools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from tactograph.sdk import F8


class Points(NamedTuple):
    """Coordinates of points; x right, y down, z towards the camera."""

    x: F8
    y: F8
    z: F8


Vector = tuple[float, float, float]
Solid = Callable[[Points], F8]

# Distances of ellipsoids and tapered tubes are approximate, so walk only this share of them.
WALK_SHARE = 0.8
WALK_STEPS = 120


def ellipsoid(centre: Vector, radii: Vector) -> Solid:
    """An ellipsoid along the axes; its distance is exact to first order at the surface."""

    def distance(at: Points) -> F8:
        scaled = [(c - m) / r for c, m, r in zip(at, centre, radii, strict=True)]
        k0 = np.sqrt(sum(s * s for s in scaled))
        k1 = np.sqrt(sum((s / r) ** 2 for s, r in zip(scaled, radii, strict=True)))
        return np.asarray(k0 * (k0 - 1) / np.maximum(k1, 1e-9))

    return distance


def tube(path: Sequence[Vector], radii: Sequence[float]) -> Solid:
    """A round tube along a path; its radius is interpolated between evenly spaced `radii`."""
    thickness = np.interp(
        np.linspace(0.0, 1.0, len(path)), np.linspace(0.0, 1.0, len(radii)), radii
    )
    ends = itertools.pairwise(zip(path, thickness.tolist(), strict=True))
    return union([_rod(start, end, r, s) for (start, r), (end, s) in ends])


def _rod(start: Vector, end: Vector, r_start: float, r_end: float) -> Solid:
    axis = np.subtract(end, start)
    square = float(axis @ axis)

    def distance(at: Points) -> F8:
        rel = [c - s for c, s in zip(at, start, strict=True)]
        along = sum(r * a for r, a in zip(rel, axis, strict=True)) / square
        t = np.clip(along, 0.0, 1.0)
        off = [r - t * a for r, a in zip(rel, axis, strict=True)]
        return np.asarray(np.sqrt(sum(o * o for o in off)) - (r_start + (r_end - r_start) * t))

    return distance


def union(solids: Sequence[Solid], blend: float = 0.0) -> Solid:
    """Solids joined; `blend` is the width over which the seam is rounded."""

    def distance(at: Points) -> F8:
        joined = solids[0](at)
        for solid in solids[1:]:
            joined = _smooth_minimum(joined, solid(at), blend)
        return joined

    return distance


def without(solid: Solid, removed: Solid, blend: float) -> Solid:
    """A solid with another one cut out of it; the rim is rounded over `blend`."""

    def distance(at: Points) -> F8:
        return -_smooth_minimum(-solid(at), removed(at), blend)

    return distance


def _smooth_minimum(a: F8, b: F8, blend: float) -> F8:
    """Quadratic smooth minimum: differs from the sharp one only where |a - b| < blend."""
    sharp = np.minimum(a, b)
    if blend == 0:
        return sharp
    overlap = np.maximum(blend - np.abs(a - b), 0.0) / blend
    return np.asarray(sharp - overlap * overlap * blend / 4)


def curve(points: Sequence[Vector], pieces: int) -> list[Vector]:
    """A Bezier curve through the first and last point, with the others as control points."""
    weights = np.linspace(0.0, 1.0, pieces + 1)[:, None]
    level = [np.broadcast_to(np.asarray(p, float), (pieces + 1, 3)) for p in points]
    while len(level) > 1:
        level = [a + weights * (b - a) for a, b in itertools.pairwise(level)]
    return [(float(x), float(y), float(z)) for x, y, z in level[0]]


def relief(solid: Solid, x: F8, y: F8, top: float, accuracy: float) -> F8:
    """Return the height of a solid above the plane z = 0, seen along the z axis.

    Above each pixel a point moves down by a share of the distance function until it is within
    `accuracy` of the surface or below the plane (sphere tracing).

    Parameters
    ----------
    x, y : coordinates of the pixels; they broadcast to H x W
    top : a height that the solid does not exceed
    """
    x, y = np.broadcast_arrays(x, y)
    height = np.zeros(x.shape)
    open = np.arange(x.size)
    at = Points(x.ravel(), y.ravel(), np.full(x.size, top))
    for _ in range(WALK_STEPS):
        distance = solid(at)
        landed = distance < accuracy
        height.flat[open[landed]] = np.maximum(at.z[landed], 0.0)
        z = at.z - WALK_SHARE * distance
        falling = ~landed & (z > 0)
        open = open[falling]
        if open.size == 0:
            break
        at = Points(at.x[falling], at.y[falling], z[falling])
    height.flat[open] = at.z if open.size else 0.0
    return height
