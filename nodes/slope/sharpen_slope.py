"""Undo the camera's blur on the slopes of a matt film."""

from typing import Annotated, Any

import numpy as np
from annotated_types import Interval

from tactograph.graph import Close, node
from tactograph.nodes import F4, Blur, Diffuse, Lens, Refraction, Slope
from tactograph.nodes.optics.lens import is_straight
from tactograph.nodes.slope.pixel_mean_slope import MAX_CORRECTION

RESAMPLING_VARIANCE = np.float32(1 / 15)
"""Variance in px^2 that `undistort` adds to an edge's width, though it keeps parabolas."""


@node(neutral="slope", tolerance=Close(2e-5, 2e-5, why="differences of rounded normals"))
def sharpen_slope(
    slope: Slope,
    blur: Blur,
    refraction: Refraction,
    diffuse: Diffuse,
    lens: Lens | None = None,
    *,
    most: Annotated[float, Interval(ge=0, le=1)] = MAX_CORRECTION,
) -> Slope:
    """Return the slopes that the film has if the slopes are those of light that was blurred.

    The light of a matt film is linear in its normal n, so a camera that blurs it with the standard
    deviation s shows the mean normal, to second order n + s^2/2 (n_xx + n_yy).  Less that term at
    the normals seen, what remains is of fourth order (equation V5).  The slopes of a coated film
    stay as they are, since its light is not linear, and those of a gel that diffuses light, since
    its edges are soft, and the blur found is not the camera's.

    Parameters
    ----------
    slope : 2 x H x W in mm per mm
    blur : s in px; 0 returns the slopes unchanged
    refraction : of the film's coat; 1 without a coat
    diffuse : length K, the share of each LED's light that the gel diffuses
    lens : images that were undistorted have wider edges than the camera's
    most : largest correction, in units of 1 + p^2 + q^2; across edges the expansion fails
    """
    if has_no_matt_blur(blur, refraction, diffuse):
        return slope
    resampled = RESAMPLING_VARIANCE if lens is not None and not is_straight(lens) else np.float32(0)
    half = np.maximum(np.float32(blur * blur) - resampled, np.float32(0)) / 2
    square = 1 + (slope * slope).sum(axis=0)
    limit = np.float32(most) * square
    normal = np.stack([-slope[0], -slope[1], np.ones_like(square)]) / np.sqrt(square)
    sharp = normal - half * _laplacian(normal)
    # Next to an edge the difference may point nowhere.
    change = -sharp[:2] / np.maximum(sharp[2], normal[2] / 2) - slope
    return np.asarray(slope + np.clip(change, -limit, limit), np.float32)


def _laplacian(planes: F4) -> F4:
    """The second derivatives n_xx + n_yy, by values two pixels away; the border repeats.

    Those of next neighbours would enlarge noise by 2.4 instead of 1.3 at a blur of 0.8 px.
    """
    around = np.pad(planes, ((0, 0), (2, 2), (2, 2)), mode="edge")
    beside = around[:, 2:-2, :-4] + around[:, 2:-2, 4:] + around[:, :-4, 2:-2] + around[:, 4:, 2:-2]
    return np.asarray((beside - 4 * planes) / 4, np.float32)


def has_no_matt_blur(blur: float, refraction: float, diffuse: F4) -> bool:
    """Return whether no camera blurs the light of a matt film in a clear gel.

    A coat's light is not linear in the normal.  Edges of diffused light are soft, so that the blur
    found there is not the camera's.
    """
    return blur == 0 or refraction != 1 or bool(diffuse.any())


sharpen_slope.opencl(grid="H W", lanes="rows")
sharpen_slope.idle(has_no_matt_blur)


@sharpen_slope.example
def _example(rng: np.random.Generator, K: int, H: int, W: int, **_: int) -> dict[str, Any]:
    """Gentle slopes of a film that mostly is matt, in a gel that mostly is clear."""
    return {
        "slope": rng.normal(0, 0.1, (2, H, W)).astype(np.float32),
        "refraction": float(rng.choice([1.0, 1.0, 1.5])),
        "diffuse": np.float32(0.2 * (rng.random() < 0.2)) * rng.random(K, np.float32),
    }
