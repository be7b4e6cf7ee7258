"""An elastic layer bonded to a rigid window: how a traction on its face moves the face.

For a traction e^(ikx) on a layer of thickness h, Young's modulus E and Poisson's ratio nu, with
q = k h and D = (3 - 4 nu) cosh 2q + 2 q^2 + 5 - 12 nu + 8 nu^2, the face moves by

    normal   2 (1 - nu^2) / (E k) ((3 - 4 nu) sinh 2q - 2q) / D         under a pressure,
    along    2 (1 - nu^2) / (E k) ((3 - 4 nu) sinh 2q + 2q) / D         under a shear along x,
    across   2 (1 + nu) / (E k) tanh q                                  under a shear along y,
    coupled  (1 + nu) / (E k) ((1 - 2 nu) (3 - 4 nu) (cosh 2q - 1) - 2 q^2) / D

(Johnson, "Contact Mechanics", 1985, section 5.8; Bentall and Johnson, "An elastic strip in plane
rolling contact", 1968).  A pressure p moves the face in its plane by coupled / k times the gradient
of p, a shear t along its normal by coupled / k times -div t: these are the 3 x 3 numbers of each
wave.  Where k h is large they are those of a half-space; where it is small the layer is squeezed as
a whole, h (1 + nu) (1 - 2 nu) / (E (1 - nu)), and sheared as a whole, 2 h (1 + nu) / E.
"""

from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from tactograph.sdk import F8

MODULUS_RANGE_KPA = 1.0, 1e5
Modulus = Annotated[float, Interval(ge=MODULUS_RANGE_KPA[0], le=MODULUS_RANGE_KPA[1])]
"""Young's modulus of a gel in kPa: below are gels that flow, above is rubber that no hand presses
in; a figure in Pa or MPa is outside."""
Thickness = Annotated[float, Interval(ge=0.05, le=100)]
"""Of a gel, mm."""
Poisson = Annotated[float, Interval(ge=0, le=0.5)]
MIN_KH, MAX_KH = 1e-3, 20.0
"""k h below which the layer is squeezed as a whole, and above which the window is not felt."""


class Compliance(NamedTuple):
    """Displacements in mm times the modulus in kPa, of waves of 1 kPa."""

    normal: F8
    along: F8
    across: F8
    coupled: F8


def layer_compliance(k: F8, thickness: float, poisson: float) -> Compliance:
    """Return the layer's answer to wave numbers k in 1/mm, its thickness in mm."""
    k = np.maximum(k, MIN_KH / thickness)
    q = np.minimum(k * thickness, MAX_KH)
    stiff = 3 - 4 * poisson
    sinh, cosh = stiff * np.sinh(2 * q), stiff * np.cosh(2 * q)
    share = 1 / (k * (cosh + 2 * q * q + 5 - 12 * poisson + 8 * poisson**2))
    plane = 2 * (1 - poisson**2) * share
    coupled = (1 - 2 * poisson) * (cosh - stiff) - 2 * q * q
    return Compliance(
        plane * (sinh - 2 * q),
        plane * (sinh + 2 * q),
        2 * (1 + poisson) * np.tanh(q) / k,
        (1 + poisson) * share * coupled,
    )


def wave_numbers(shape: tuple[int, int], pixel: float) -> F8:
    """Wave numbers of a cosine transform of H x W pixels, in 1/mm."""
    rows, columns = shape
    v = np.pi * np.arange(rows)[:, None] / (rows * pixel)
    u = np.pi * np.arange(columns)[None] / (columns * pixel)
    return np.hypot(u, v)
