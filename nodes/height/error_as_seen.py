"""Bring the height's standard deviation from the ideal grid back to the pixels of the camera."""

from __future__ import annotations

import numpy as np

from tactograph.graph import Close, node
from tactograph.nodes import HeightError, Lens
from tactograph.nodes.light._lens import ideal_places, is_straight


@node(
    neutral="error",
    tolerance=Close(3e-4, why="places rounded to 1e-5 px, times a step between two pixels"),
)
def error_as_seen(error: HeightError, lens: Lens) -> HeightError:
    """Return the standard deviation of the height at each pixel of the camera.

    Values between pixels are interpolated linearly.  Cubic convolution, as in `as_seen`,
    overshoots beside the film at rest, and a standard deviation is never negative.  Pixels that
    look beyond the ideal grid repeat its border.  Without a lens the standard deviation is
    returned unchanged.

    Parameters
    ----------
    error
        H x W in mm on the ideal grid.
    lens
        Length 8, as `read_lens` gives it (equations L1 and L2 of `_lens`).
    """
    if is_straight(lens):
        return error
    rows, columns = error.shape
    u, v = ideal_places(lens, error.shape)
    u = np.clip(u, np.float32(0), np.float32(columns - 1))
    v = np.clip(v, np.float32(0), np.float32(rows - 1))
    left, top = u.astype(np.int32), v.astype(np.int32)
    right, bottom = np.minimum(left + 1, columns - 1), np.minimum(top + 1, rows - 1)
    across, down = u - left.astype(np.float32), v - top.astype(np.float32)
    upper = (1 - across) * error[top, left] + across * error[top, right]
    lower = (1 - across) * error[bottom, left] + across * error[bottom, right]
    return (1 - down) * upper + down * lower


error_as_seen.opencl(grid="H W", lanes="rows")
error_as_seen.idle(is_straight)
