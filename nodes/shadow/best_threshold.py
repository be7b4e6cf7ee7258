"""The threshold of the paper's shadow test that is best on the calibration's own press."""

import numpy as np

from tactograph.graph import InputError, node
from tactograph.nodes import LightPositions, LutLight, LutLit, LutSlope, NullVector, Spread


@node
def best_threshold(
    light: LutLight, lit: LutLit, slope: LutSlope, lights: LightPositions, null: NullVector
) -> Spread:
    """Return the threshold of |a.I| that is farthest above chance (Youden 1950).

    Of all thresholds, the one is best that has the greatest difference of two shares: of the
    press's pixels in shadow that exceed it, and of the lit ones that do.  Pixels in shadow are
    those that an LED leaves black; on film that diffuses light there are none, so that they are
    those whose slope turns away from an LED, for a ball is convex.

    Parameters
    ----------
    light, lit, slope : N x K, N and N x 2, the calibration's tables (`build_lut`)
    lights : K x 3 in mm; for its slope, every pixel is taken to lie in the middle of the film
    null : length K, the vector a of equation 11

    Returns
    -------
    lambda, for `shadow_linear` as its `spread` with `threshold=1`.

    Raises
    ------
    InputError
        If the press shows no shadow, or nothing else.
    """
    shadowed = lit != (1 << light.shape[1]) - 1
    if not shadowed.any():
        shadowed = (slope @ lights[:, :2].T >= lights[:, 2]).any(axis=1)
    dark, bright = int(shadowed.sum()), int((~shadowed).sum())
    if not dark or not bright:
        raise InputError(
            f"of the calibration's {len(light)} pixels {dark} are in shadow, so no threshold is "
            "best; take the paper's, or calibrate with a press that is deep enough for shadows"
        )
    departure = np.abs(light.astype(np.float64) @ null)
    order = np.argsort(departure)
    # Left behind by a threshold between one pixel and the next: of either kind.
    below = np.cumsum(np.stack([~shadowed[order] / bright, shadowed[order] / dark]), axis=1)
    best = int(np.argmax(below[0] - below[1]))
    above = min(best + 1, len(light) - 1)
    return float(departure[order[[best, above]]].mean())
