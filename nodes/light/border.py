"""The border of a frame, which shows the film at rest."""

from typing import Any

import numpy as np

from tactograph.nodes import F4


def border_of(planes: Any, width_px: int) -> Any:
    """Return the outermost pixels of planes; all of them if these are no wider than two borders."""
    ends, rows = [planes], planes[..., width_px:-width_px, :]
    if min(planes.shape[-2:]) > 2 * width_px:
        ends = [planes[..., :width_px, :], planes[..., -width_px:, :]]
        ends += [rows[..., :width_px], rows[..., -width_px:]]
    return np.concatenate([part.reshape(*planes.shape[:-2], -1) for part in ends], axis=-1)


def border_level(light: F4) -> F4:
    """Return the lower median of each LED's light, K x H x W, along the border of the frame."""
    ring = border_of(light, 1)
    middle = (ring.shape[1] - 1) // 2
    return np.asarray(np.partition(ring, middle, axis=1)[:, middle])
