"""Light of a film whose dependence on slope varies over the film."""

import numpy as np

from tactograph.rings.oneshot.nodes.map.reflectance_map import (
    SHADE_COUNT,
    ReflectanceMap,
    maps_over_film,
    rough_film,
    shading,
)
from tactograph.sdk import Close, Height, Light, SizeLimit, Slope, SlopeNormal, node


@node(
    sizes={"K": SizeLimit(1, 8, "labels have 8 bits")},
    tolerance=Close(1e-4, 1e-4, why="sums of many terms"),
)
def mapped_light(slope: Slope, height: Height, reflectance: ReflectanceMap) -> Light:
    """Return the light relative to the film at rest that equation M1 gives a film.

    Parameters
    ----------
    slope, height : 2 x H x W, and H x W in mm
    reflectance : K x 9 x 15, as `fit_reflectance_map` gives it
    """
    normal = SlopeNormal(*slope).normal
    maps = maps_over_film(reflectance, height.shape)
    planes = [shading(normal, c)[0] + c[SHADE_COUNT - 1] * height for c in maps]
    return np.asarray(planes, np.float32) + 1


mapped_light.opencl(grid="K H W", lanes="rows")
mapped_light.example(rough_film)
