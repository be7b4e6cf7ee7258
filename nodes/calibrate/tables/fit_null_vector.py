"""Fit the vector that is orthogonal to the light of every fully lit pixel."""

from typing import NamedTuple

import numpy as np

from tactograph.graph import node
from tactograph.nodes import Labels, Light, Mask, NullVector, Spread, robust_deviation
from tactograph.nodes.calibrate.tables.build_lut import refuse_few


class NullFit(NamedTuple):
    """The vector a of equation 11, and the spread of a.I where all LEDs reach."""

    null: NullVector
    spread: Spread


@node
def fit_null_vector(light: Light, mask: Mask, lit: Labels) -> NullFit:
    """Find a with a.I = 0: the eigenvector of I I^T for the smallest eigenvalue (section 3.2).

    The shadow threshold lambda is a multiple of the spread.  Three light directions are linearly
    independent, so with three LEDs there is no such vector: zeros are returned, and the shadow
    test refuses them.

    Parameters
    ----------
    light, mask, lit
        Of the calibration object: K x H x W, H x W, H x W.  Only pixels that all LEDs
        reach are used.

    Returns
    -------
    Unit vector of length K, and the robust standard deviation of a.I.

    Raises
    ------
    InputError
        If fewer than 100 pixels are reached by all LEDs.
    """
    count = light.shape[0]
    if count < 4:
        return NullFit(np.zeros(count, np.float32), 0.0)
    chosen = (mask > 0) & (lit == (1 << count) - 1)
    refuse_few(chosen, f"all {count} LEDs", "press less deep, or check that every LED flashes")
    lit_light = light[:, chosen].astype(np.float64)
    null = np.linalg.eigh(lit_light @ lit_light.T)[1][:, 0]
    null *= np.sign(null[np.argmax(np.abs(null))])
    residual = null @ lit_light
    # Robust, so that the few remaining shadowed pixels do not increase it.
    spread = robust_deviation(residual - np.median(residual))
    return NullFit(null.astype(np.float32), float(spread))
