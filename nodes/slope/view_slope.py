"""Convert slopes of the film to slopes of the height that a near camera sees, and back."""

from typing import Any

import numpy as np

from tactograph.graph import Close, node
from tactograph.nodes import Height, PixelSize, Slope, Vergence
from tactograph.nodes.optics.near_light import MIN_VIEW_SHARE, image_places

MAX_SQUARE = 1 / MIN_VIEW_SHARE**2 - 1
"""Square of the steepest slope that the camera sees."""


def is_orthographic(camera: Vergence) -> bool:
    """Return whether the camera is at infinity, so that the seen height is the film's height."""
    return camera == 0


@node(neutral="slope", tolerance=Close(1e-5, 1e-5, why="division"))
def view_slope(
    slope: Slope, height: Height, camera: Vergence, pixel: PixelSize, *, inverse: bool = False
) -> Slope:
    """Return the slopes of the height as the camera sees it, or of the film (`inverse`).

    A pinhole at D above the film at rest maps P = (x, y, z) to the pixel (u, v) = (x, y) / f
    with f = 1 - z / D.  With the seen height Z = z / f that is a projective map, which keeps
    planes and straight lines: shadows and integration in (u, v, Z) are those of an
    orthographic camera (equation V1).  The film's plane z = p x + q y + c becomes
    Z = (p u + q v + c) / (1 - c / D).  Back, Z = P u + Q v + C becomes
    z = (P x + Q y + C) / (1 + C / D) (equation V2).  The camera does not see film that faces it by
    less than `MIN_VIEW_SHARE`, which limits the seen slope.

    Parameters
    ----------
    slope : 2 x H x W, of the film, or of the seen height
    height : H x W in mm, the seen height as far as known
    camera : 1 / D in 1/mm; 0 returns the slope unchanged
    pixel : mm per px
    inverse : convert slopes of the seen height to slopes of the film
    """
    if is_orthographic(camera):
        return slope
    by = np.float32(camera)
    (u, v), (p, q) = image_places(height.shape, pixel), slope
    if inverse:
        return slope / np.maximum(1 + by * (height - p * u - q * v), MIN_VIEW_SHARE)
    z = height / (1 + by * height)
    nearer = 1 - by * z
    viewed = slope / np.maximum(1 - by * (z - (p * u + q * v) * nearer), MIN_VIEW_SHARE)
    square = viewed[0] * viewed[0] + viewed[1] * viewed[1]
    steeper = square > MAX_SQUARE
    return np.where(steeper, viewed * np.sqrt(MAX_SQUARE / np.where(steeper, square, 1)), viewed)


view_slope.opencl(grid="H W", lanes="grid")
view_slope.idle(is_orthographic)


@view_slope.example
def _example(rng: np.random.Generator, H: int, W: int, **_: int) -> dict[str, Any]:
    """Gentle slopes, and a few slopes of rims, which hardly face the camera."""
    steep = rng.random((H, W)) < 0.1
    return {"slope": (rng.normal(0, 0.3, (2, H, W)) * np.where(steep, 60, 1)).astype(np.float32)}
