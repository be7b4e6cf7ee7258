"""The spherical harmonics of a normal up to second order, the basis of a reflectance."""

import numpy as np

from tactograph.nodes import F4


def harmonics(slope: F4) -> F4:
    """Return the nine harmonics, 9 x ..., of slopes 2 x ..., without normalising factors.

    They are 1, n_x, n_y, n_z, n_x n_y, n_x n_z, n_y n_z, n_x^2 - n_y^2, 3 n_z^2 - 1 of the unit
    normal n = (-p, -q, 1) / sqrt(1 + p^2 + q^2), which points to the camera.
    """
    p, q = slope
    z = 1 / np.sqrt(1 + p * p + q * q)
    x, y = -p * z, -q * z
    return np.stack([np.ones_like(z), x, y, z, x * y, x * z, y * z, x * x - y * y, 3 * z * z - 1])
