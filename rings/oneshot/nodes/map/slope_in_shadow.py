"""Slope of film that a wall hides from one of a one-shot sensor's colours."""

from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.rings.oneshot.nodes.map.reflectance_map import (
    SHADE_COUNT,
    ReflectanceMap,
    shading,
    terms,
)
from tactograph.rings.oneshot.nodes.map.solve_reflectance_map import solved
from tactograph.sdk import F4, Height, Light, Port, Slope, SlopeNormal, node

MattDeviation = Annotated[float, Port(unit="1")]
"""Standard deviation of a matt film's light from the map; 0 of any other film."""
MAX_SHADOW_LIGHT = 0.25
"""Light of film half a pixel inside a shadow, under a blur of 0.7 px; lighter film may be steep."""
MIN_LIGHTS = 3
"""Of two lights none can be left out: a slope has two unknowns."""
CERTAIN_DEVIATIONS = 3.0
"""Standard deviations of the light by which it contradicts what is not the case."""
ROOT_ROUNDS = 4
"""Rounds in which pixels choose between two slopes by their neighbours."""


@node(neutral="slope")
def slope_in_shadow(
    slope: Slope,
    light: Light,
    flat: Light,
    height: Height,
    reflectance: ReflectanceMap,
    deviation: MattDeviation,
) -> Slope:
    """Return the slope with pixels solved anew of which the darkest light is in a cast shadow.

    Three lights over-determine a slope by one, so that a shadow contradicts the map.  Without
    the darkest light two slopes explain the others: film in the shadow, and its mirror image in
    the plane of both lights, a wall.  A wall's foot rises towards the wall, away from the light
    that it hides; so film that would turn to that light, and be brighter than level film, is
    the wall itself and keeps its slope.  At the foot the slope nearer to the mean of 3 x 3
    pixels is taken.  Only on a matt film that throws no light on itself are two lights enough to
    tell a foot from its wall.

    Parameters
    ----------
    slope : 2 x H x W, from all lights
    light, flat, height, reflectance : as for `solve_reflectance_map`
    deviation : of the light from the map; 0 where film is not known to be matt, nothing changes
    """
    if deviation == 0 or len(light) < MIN_LIGHTS:
        return slope
    least = np.float32(CERTAIN_DEVIATIONS * deviation)
    rows, columns = np.nonzero(light.min(axis=0) < MAX_SHADOW_LIGHT)
    place = terms(columns.astype(np.float64), rows.astype(np.float64), light.shape[1:])
    maps = np.einsum("kbq,qn->kbn", reflectance, place, optimize=True).astype(np.float32)
    candidate_light, weight = light[:, rows, columns], flat[:, rows, columns]
    rests = list(candidate_light - 1 - maps[:, SHADE_COUNT - 1] * height[rows, columns])
    steep = slope[:, rows, columns]
    darkest = candidate_light == candidate_light.min(axis=0)
    near = solved(rests, weight * ~darkest, maps, np.zeros_like(steep))
    lack = -(_departure(rests, maps, near) * darkest).sum(axis=0)
    torn = np.square(_departure(rests, maps, steep)).sum(axis=0) > least**2
    shaded = torn & (lack > least) & (candidate_light.min(axis=0) + lack < 1 + least)
    rows, columns, maps = rows[shaded], columns[shaded], maps[..., shaded]
    far = solved(
        [rest[shaded] for rest in rests], (weight * ~darkest)[:, shaded], maps, steep[:, shaded]
    )
    return _nearer_to_neighbours(slope, rows, columns, near[:, shaded], far)


def matt_deviation(quality: dict[str, float], residual: float) -> float:
    """Return the deviation of a film that `judge_radius` finds matt, and 0 of another."""
    return residual if quality.get("matt") else 0.0


def _departure(rests: list[F4], maps: F4, slope: F4) -> F4:
    """Light less that of a slope: K x N."""
    normal = SlopeNormal(*slope).normal
    model_light = [shading(normal, c)[0] for c in maps]
    return np.asarray(np.stack(rests) - np.stack(model_light), np.float32)


def _nearer_to_neighbours(
    slope: F4, rows: NDArray[np.intp], columns: NDArray[np.intp], near: F4, far: F4
) -> F4:
    """Give pixels one of two slopes, whichever lies nearer to the mean of those around."""
    out = slope.copy()
    out[:, rows, columns] = near
    for _ in range(ROOT_ROUNDS):
        mean = np.stack([cv2.blur(plane, (3, 3)) for plane in out])[:, rows, columns]
        off = np.hypot(*(far - mean)) < np.hypot(*(near - mean))
        out[:, rows, columns] = np.where(off, far, near)
    return out
