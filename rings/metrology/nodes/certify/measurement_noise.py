"""Measurement noise, flatness and drift from captures between which nothing moved."""

import numpy as np

from tactograph.rings.metrology.nodes.certify.measure_touches import Heights
from tactograph.sdk import InputError, node

MIN_REPEATS = 2


@node
def measurement_noise(height: Heights | None = None) -> dict[str, float]:
    """Return the noise of a single height and the drift, of repeats of one still touch.

    ISO 25178-600: noise added to the output during normal use.  Sq of the difference of two
    maps, over the root of two, since both have it (ISO 25178-700; Haitjema and Morel 2005);
    neighbours in time, so that drift is no noise, nor is their mean difference.  Repeatability has
    all of it, the standard deviation over the repeats.  Drift is the slope of the mean height
    over the repeats' number by least squares.

    Parameters
    ----------
    height : N x H x W in mm, in the order in which they were taken; None: no repeats

    Returns
    -------
    dict
        ``measurement_noise_um``, ``topography_repeatability_um``, ``noise_repeats``; from three
        repeats on ``drift_um``, from the first to the last, and ``drift_error_um``, its standard
        uncertainty.

    Raises
    ------
    InputError
        If there is one repeat only.
    """
    if height is None:
        return {}
    if len(height) < MIN_REPEATS:
        raise InputError("one still capture was given; noise is what two or more differ by")
    maps = 1e3 * height.astype(np.float64)
    apart = np.diff(maps, axis=0)
    apart = apart - np.nanmean(apart, axis=(1, 2), keepdims=True)
    noise = float(np.sqrt(np.nanmean(np.square(apart)) / 2))
    figures: dict[str, float] = {
        "measurement_noise_um": noise,
        "topography_repeatability_um": float(np.sqrt(np.nanmean(maps.var(axis=0, ddof=1)))),
        "noise_repeats": float(len(maps)),
    }
    levels, order = np.nanmean(maps, axis=(1, 2)), np.arange(len(maps)) - (len(maps) - 1) / 2
    if len(maps) > MIN_REPEATS:
        drift = float(order @ levels / (order @ order))
        residual = levels - levels.mean() - drift * order
        slope_error = np.sqrt(residual @ residual / (len(maps) - 2) / (order @ order))
        figures["drift_um"] = drift * (len(maps) - 1)
        figures["drift_error_um"] = float(slope_error) * (len(maps) - 1)
    return figures
