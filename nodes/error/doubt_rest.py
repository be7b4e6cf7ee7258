"""Add errors that the noise does not show: of film taken to be at rest, of scale, and of zero."""

from typing import Annotated, Any

import numpy as np
from annotated_types import Gt

from tactograph.graph import Close, node
from tactograph.nodes import (
    Height,
    HeightError,
    Mask,
    PixelSize,
    ScaleError,
    SlopeVariance,
    ZeroError,
)


@node(neutral="error", tolerance=Close(1e-7, 1e-5, why="square roots"))
def doubt_rest(
    error: HeightError,
    rest: Mask,
    free: Height,
    variance: SlopeVariance,
    pixel: PixelSize,
    apart: Height,
    height: Height,
    skirt: HeightError,
    scale_error: ScaleError | None = None,
    zero: ZeroError | None = None,
    *,
    level: Annotated[float, Gt(0)] = 4.5,
    steepest: Annotated[float, Gt(0)] = 1.0,
) -> HeightError:
    """Return the standard deviation of the height, including that of the film at rest.

    Film is taken to be at rest, and held at zero, where its light is 1 within noise.  A touch may
    hide there, with this standard deviation of its height::

        sqrt(free^2 + (level pixel)^2 / 3 (variance_p + variance_q) / 2)

    `free` is a height integrated from the slopes alone.  It shows a wide touch: a step, or a touch
    whose top reaches the border of the frame and looks calm there.  Where pieces of such film lie
    farther `apart` than `free`, their distance counts, also for film that hangs between them.  A
    narrow touch hides below the noise of a slope over one pixel, times the `level` up to which
    light counts as noise.  Any height up to that limit is equally likely, so its variance is a
    third of the square.

    The error of the calibration's scale, a share of the height, is added where film is not at rest,
    and the errors of the touch's skirt and of the height's zero everywhere.  A tilt of the whole
    film is not included: it looks like LEDs that have faded.

    Parameters
    ----------
    error : H x W in mm, from `height_error`, zero on the film at rest
    rest : H x W, 1 on the film at rest
    free : H x W in mm, a height for which no film was held at zero
    variance : 2 x H x W, the variance of p and q
    pixel : mm per px
    apart : H x W in mm, the distance of pieces of film at rest (`rest_apart`)
    height : H x W in mm
    skirt : H x W in mm, the error of the skirt's height (`skirt_height`)
    scale_error : relative error of all heights; None: the scale is exact
    zero : error of the zero in mm (`zero_error`); None: the zero is known
    level : standard deviations of the light that `calm_film` counts as noise
    steepest : largest standard deviation of a slope

    Returns
    -------
    H x W in mm, never zero.
    """
    slopes = np.minimum(variance[0] + variance[1], np.float32(2 * steepest * steepest))
    hidden = np.float32((level * pixel) ** 2 / 6) * slopes
    moved, scaled = apart * apart, np.float32(scale_error or 0) * height
    held, off = np.maximum(free * free, moved) + hidden, error * error + moved + scaled * scaled
    without_zero = np.sqrt(np.where(rest != 0, held, off) + skirt * skirt)
    return np.asarray(np.hypot(without_zero, np.float32(zero or 0)), np.float32)


doubt_rest.opencl(grid="H W", lanes="grid")


@doubt_rest.example
def _example(rng: np.random.Generator, H: int, W: int, **_: int) -> dict[str, Any]:
    """Some film is at rest, and some slopes are unknown."""
    variance = rng.uniform(1e-6, 1e-2, (2, H, W))
    variance[:, rng.random((H, W)) < 0.1] = 1e12
    free, apart, height, skirt = rng.normal(0, 0.01, (4, H, W)).astype(np.float32)
    return {"free": free, "apart": apart, "height": height, "skirt": np.abs(skirt)} | {
        "rest": rng.integers(0, 2, (H, W)).astype(np.uint8),
        "variance": variance.astype(np.float32),
        "scale_error": float(rng.uniform(0, 0.3)),
    }
