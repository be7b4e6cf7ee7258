"""The standard deviation of a one-shot sensor's height."""

from typing import Annotated

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.rings.oneshot.nodes.map.map_departure import MIN_MAP_ERROR
from tactograph.rings.oneshot.nodes.map.raise_walls import BLUR_PX, MIN_SLOPE, uphill
from tactograph.rings.oneshot.nodes.map.reflectance_map import (
    ReflectanceMap,
    maps_over_film,
    shading,
)
from tactograph.sdk import (
    F4,
    Height,
    HeightError,
    Misfit,
    PixelSize,
    Port,
    Slope,
    SlopeNormal,
    node,
    robust_deviation,
)
from tactograph.sdk.nodes import calm_film, edge_variance, integrate_dct, rest_at_border, rest_mask


@node
def map_error(
    height: Height,
    slope: Slope,
    light: Annotated[F4, Port("K h w", "1")],
    reflectance: ReflectanceMap,
    misfit: Misfit,
    pixel: PixelSize,
) -> HeightError:
    """Return the standard deviation of the height: of film at rest, and what walls add.

    Three lights leave nothing to check a slope by, so its error is that which two laws give.
    Light that departs from the map by d moves the slope uphill by d over the root of the sum
    of (dI_k / ds)^2, at most by all of the slope.  And light that the lens blurs over
    an edge shows a mean normal, whose slope is less than the mean slope (`edge_variance`).  All
    walls err alike, so both are integrated as the slopes are, uphill everywhere: what stands
    between walls has the error of the walls that carry it.

    Film is at rest where light is calm and joined to the frame's border: a flat top is calm, too,
    but walls surround it.  Heights there are errors, and their median magnitude is that of all.

    Parameters
    ----------
    height, slope : H x W in mm above the film at rest, 2 x H x W
    light : K x h x w, relative to the film at rest, on cells
    reflectance : K x 9 x 15, as `fit_reflectance_map` gives it
    misfit : length 5, the calibration's misfit
    pixel : mm per px

    Returns
    -------
    H x W in mm, one standard deviation; on the film at rest no less than the height there.
    """
    doubt = _uphill_doubt(slope, reflectance, max(float(misfit[2]), MIN_MAP_ERROR))
    walls = rest_at_border(integrate_dct(doubt, pixel))
    rest = _film_at_rest(light, height.shape)
    heights_at_rest = height[rest] if rest.any() else height
    usual = np.float32(robust_deviation(heights_at_rest))
    at_rest = np.where(rest, np.maximum(np.abs(height), usual), usual)
    return np.asarray(np.hypot(at_rest, walls), np.float32)


def _uphill_doubt(slope: Slope, reflectance: F4, departure: float) -> Slope:
    """The standard deviation of the slope along itself, as a slope."""
    steep, direction = np.hypot(*slope), uphill(slope)
    at = SlopeNormal(*slope)
    information = np.zeros_like(steep)
    for c in maps_over_film(reflectance, steep.shape):
        by_p, by_q = at.by_slope(shading(at.normal, c)[1])
        along = by_p * direction[0] + by_q * direction[1]
        information += along * along
    slope_variance = np.square(np.maximum(steep, MIN_SLOPE))
    variance = 1 / (information / np.float32(departure**2) + 1 / slope_variance)
    spread = edge_variance(np.stack([variance, variance]), slope, BLUR_PX, factor=1.0)
    return np.asarray(direction * np.sqrt(spread), np.float32)


def _film_at_rest(light: F4, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Where light is 1 as far as the frame's border."""
    joined = rest_mask(calm_film(light), 1.0, margin_mm=0.0)
    rows, columns = shape
    return cv2.resize(joined, (columns, rows), interpolation=cv2.INTER_NEAREST) != 0
