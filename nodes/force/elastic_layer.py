"""An elastic layer bonded to a rigid window: how pressure on its face moves the face.

For a pressure p e^(ikx) on a layer of thickness h, Young's modulus E and Poisson's ratio nu, the
normal displacement is C(k) p with q = k h and

    C(k) = 2 (1 - nu^2) / (E k) ((3 - 4 nu) sinh 2q - 2q)
                              / ((3 - 4 nu) cosh 2q + 2 q^2 + 5 - 12 nu + 8 nu^2),

without friction on the face (Johnson, "Contact Mechanics", 1985, section 5.8; Bentall and Johnson,
"An elastic strip in plane rolling contact", 1968).  Where k h is large this is the half-space, 2 (1
- nu^2) / (E k); where it is small the layer is squeezed as a whole, h (1 + nu) (1 - 2 nu) / (E (1 -
nu)).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MIN_KH, MAX_KH = 1e-3, 20.0
"""k h below which the layer is squeezed as a whole, and above which the window is not felt."""


def layer_compliance(k: Array, thickness: float, poisson: float) -> Array:
    """E C(k), in mm, for wave numbers k in 1/mm and a thickness in mm.

    Divided by a modulus in kPa it is the displacement in mm of a pressure of 1 kPa.
    """
    k = np.maximum(k, MIN_KH / thickness)
    q = np.minimum(k * thickness, MAX_KH)
    stiff = 3 - 4 * poisson
    share = stiff * np.sinh(2 * q) - 2 * q
    share /= stiff * np.cosh(2 * q) + 2 * q * q + 5 - 12 * poisson + 8 * poisson**2
    return 2 * (1 - poisson**2) * share / k


def wave_numbers(shape: tuple[int, int], pixel: float) -> Array:
    """Wave numbers of a cosine transform of H x W pixels, in 1/mm."""
    rows, columns = shape
    v = np.pi * np.arange(rows)[:, None] / (rows * pixel)
    u = np.pi * np.arange(columns)[None] / (columns * pixel)
    return np.hypot(u, v)
