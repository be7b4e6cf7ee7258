"""Interpolate between pixels by the cubic convolution of Catmull and Rom, which keeps pixel values.

E. Catmull and R. Rom, "A class of local interpolating splines", 1974; R. Keys, "Cubic
convolution interpolation for digital image processing", 1981, with a = -1/2.  A quadratic
surface is reproduced exactly.  Beyond the frame the border repeats.
"""

import numpy as np

from tactograph.nodes import F4


def between_pixels(plane: F4, x: F4, y: F4) -> F4:
    """Return the plane's values at columns `x` and rows `y`, of any one shape.

    A place beyond the frame is moved to the nearest place inside.
    """
    rows, columns = plane.shape
    x = np.clip(x, np.float32(0), np.float32(columns - 1))
    y = np.clip(y, np.float32(0), np.float32(rows - 1))
    left, top = np.floor(x), np.floor(y)
    across, down = _weights(x - left), _weights(y - top)
    at_x, at_y = left.astype(np.int32), top.astype(np.int32)
    neighbours = [np.clip(at_x + (i - 1), 0, columns - 1) for i in range(4)]
    flat, total = plane.ravel(), np.zeros(x.shape, np.float32)
    for j in range(4):
        start = np.clip(at_y + (j - 1), 0, rows - 1) * columns
        line = np.zeros(x.shape, np.float32)
        for i in range(4):
            line += across[i] * flat[start + neighbours[i]]
        total += down[j] * line
    return total


def _weights(t: F4) -> tuple[F4, F4, F4, F4]:
    """The weights of the pixels at -1, 0, 1 and 2 for a place at `t`, 0 to 1."""
    half = np.float32(0.5)
    tt = t * t
    ttt = tt * t
    return (
        half * (2 * tt - t - ttt),
        half * (3 * ttt - 5 * tt + 2),
        half * (4 * tt - 3 * ttt + t),
        half * (ttt - tt),
    )
