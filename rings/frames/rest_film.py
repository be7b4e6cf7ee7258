"""The film at rest as camera frames show it: averaged over cells, to compare frames with."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.sdk import F4, Dark, Light

Plane = NDArray[np.uint8] | NDArray[np.uint16]
CELL_ROWS = 60
"""Approximate number of rows to which frames are averaged."""
MIN_REST_LIGHT = 0.02
"""Light of the film at rest below which cells are not used; as for `flat_field`."""
MAX_DEPARTURE = 0.04
"""Largest relative departure from an LED's pattern of a cell at rest."""


@dataclass(frozen=True)
class RestFilm:
    """The film at rest, for comparison with frames in `see`.

    Parameters
    ----------
    patterns : K x h x w: each LED's flat frame, averaged over cells
    scale : the same, but at least `MIN_REST_LIGHT`, as a divisor of light
    confusion
        K x K x hw: departure of the film at rest under the first LED from the pattern of the
        second, squared and truncated.
    dark : h x w: all LEDs off
    size : H, W of the camera's frames
    """

    patterns: F4
    scale: F4
    confusion: F4
    dark: F4
    size: tuple[int, int]


def make_film(flat: Light, dark: Dark | None = None) -> RestFilm:
    """Prepare the calibration's flat frames (K x H x W) and dark frame (H x W)."""
    patterns = np.stack([cells(plane) for plane in flat])
    scale = np.maximum(patterns, np.float32(MIN_REST_LIGHT))
    none = np.zeros(flat.shape[1:], np.float32)
    unlit = cells(none if dark is None else dark)
    return RestFilm(patterns, scale, _confusion(scale), unlit, flat.shape[1:])


def _confusion(scale: F4) -> F4:
    rows = scale.reshape(len(scale), -1)
    ratio = rows[:, None] / rows
    return truncated(ratio / upper_median(ratio)[..., None] - 1)


def light_of(frame: Plane, full: float = 0.0) -> F4:
    """Return cells of a frame, relative to the camera's largest value."""
    return cells(frame) / np.float32(top_of(frame, full))


def top_of(frame: Plane, full: float) -> float:
    """Return the camera's largest value: `full`, or if that is 0 that of the frame's type."""
    return full or float(np.iinfo(frame.dtype).max)


def full_scale(bits: int | None) -> float:
    """Return the largest value of a camera of so many bits; 0: that of the frame's type."""
    return float(2**bits - 1) if bits else 0.0


def cells(plane: NDArray[np.generic]) -> F4:
    """Return means over square cells, in about `CELL_ROWS` rows, to reduce noise."""
    factor = max(1, round(plane.shape[0] / CELL_ROWS))
    size = max(plane.shape[1] // factor, 1), max(plane.shape[0] // factor, 1)
    small = cv2.resize(plane.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32)


def truncated(off: F4) -> F4:
    """Return departures limited to `MAX_DEPARTURE` and squared."""
    limited = np.minimum(np.abs(off), np.float32(MAX_DEPARTURE))
    return np.asarray(limited * limited, np.float32)


def upper_median(values: F4) -> F4:
    """Return the (upper) median along the last axis, ten times faster than NumPy's."""
    half = values.shape[-1] // 2
    return np.asarray(np.partition(values, half)[..., half])
