"""The best threshold of the paper's shadow test on the calibration's press."""

import numpy as np

from tactograph.graph import InputError, node
from tactograph.nodes import LightPositions, LutLight, LutLit, LutSlope, NullVector, Spread


@node
def best_threshold(
    light: LutLight, lit: LutLit, slope: LutSlope, lights: LightPositions, null: NullVector
) -> Spread:
    """Return the threshold of |a.I| with the largest Youden index (Youden 1950).

    The index is the share of the press's shadowed pixels above the threshold, minus the share of
    its lit pixels above it.  A pixel is shadowed if one of its lights is black.  If a film that
    diffuses light has no black pixels, a pixel is shadowed if its slope faces away from an LED; a
    ball is convex, so it casts no other shadow on itself.

    Parameters
    ----------
    light, lit, slope : N x K, N and N x 2, the calibration's tables (`build_lut`)
    lights : K x 3 in mm; pixels are taken to lie in the middle of the film
    null : length K, the vector a of equation 11

    Returns
    -------
    lambda, for `shadow_linear` as its `spread` with `threshold=1`.

    Raises
    ------
    InputError
        If the press has no shadowed pixels, or no lit ones.
    """
    shadowed = lit != (1 << light.shape[1]) - 1
    if not shadowed.any():
        shadowed = (slope @ lights[:, :2].T >= lights[:, 2]).any(axis=1)
    dark, bright = int(shadowed.sum()), int((~shadowed).sum())
    if not dark or not bright:
        raise InputError(
            f"{dark} of the calibration's {len(light)} pixels are shadowed, so no threshold is "
            "best; use the paper's, or calibrate with a press that is deep enough to cast shadows"
        )
    departure = np.abs(light.astype(np.float64) @ null)
    order = np.argsort(departure)
    # The shares of lit and of shadowed pixels below a threshold behind each pixel.
    below = np.cumsum(np.stack([~shadowed[order] / bright, shadowed[order] / dark]), axis=1)
    best = int(np.argmax(below[0] - below[1]))
    above = min(best + 1, len(light) - 1)
    return float(departure[order[[best, above]]].mean())
