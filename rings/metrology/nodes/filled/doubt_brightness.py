"""State how much of a height hangs on the brightness of film that rests nowhere."""

import numpy as np

from tactograph.rings.metrology.nodes.filled.level_plane import level_plane
from tactograph.rings.metrology.nodes.filled.scale_height import Scale
from tactograph.sdk import Height, HeightError, PixelSize, ScaleError, Slope, node, warn
from tactograph.sdk.nodes import integrate_dct

MAX_SLOPE_CHANGE = np.float32(0.3)
"""Largest difference of two slopes; a larger one is a label that flips, not brightness."""


@node(neutral="error")
def doubt_brightness(
    error: HeightError,
    height: Height,
    held: Slope,
    free: Slope,
    pixel: PixelSize,
    scale_error: ScaleError | None = None,
    *,
    level: str = "plane",
    scale: Scale | None = None,
) -> HeightError:
    """Add half the difference between heights of film of known and of unknown brightness.

    Touched film is brighter, by some per cent, than film at rest.  Where none is at rest, what it
    is brighter than is not seen.  Slopes of a film whose brightness is known and of one whose
    brightness is any are the two ends of what the light may mean.  A step of known depth settles
    it, and the scale that the calibration left open, up to the uncertainty of the scale that it
    gives.  A warning says when brightness makes up more than all other errors.

    Parameters
    ----------
    error, height : H x W in mm; the height above the plane, scaled
    held, free : 2 x H x W, slopes found with the brightness held, and left free
    pixel : mm per px
    scale_error : relative error of all heights, as `judge_radius` gives it
    level : as for `level_plane`
    scale : as for `scale_height`

    Returns
    -------
    H x W in mm.
    """
    if scale is not None:
        factor, uncertain = scale
        return np.asarray(np.hypot(error * factor, height / factor * uncertain), np.float32)
    change = np.clip(free - held, -MAX_SLOPE_CHANGE, MAX_SLOPE_CHANGE)
    share = level_plane(integrate_dct(change, pixel), level=level) / 2
    combined = np.hypot(np.hypot(error, share), height * (scale_error or 0.0))
    of_brightness, of_all = (
        1e3 * float(np.sqrt(np.nanmean(np.square(each, dtype=float)))) for each in (share, combined)
    )
    if of_brightness**2 > of_all**2 - of_brightness**2:
        warn(
            "no film is taken for film at rest: heights are above a plane, and how bright touched "
            f"film is makes up {of_brightness:.2g} of the {of_all:.2g} um that are stated (root "
            "mean square); a step of known depth settles it (measure_step, `scale`=RATIO)"
        )
    return np.asarray(combined, np.float32)
