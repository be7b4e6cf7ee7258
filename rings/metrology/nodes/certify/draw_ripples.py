"""Film with ripples of all wavelengths, to be seen by a calibration's own model."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval

from tactograph.rings.metrology.nodes.certify._sensor import certified_sensor
from tactograph.sdk import F8, Height, Light, Slope, node

RIPPLE_SLOPE = 0.1
"""Root mean square of the slopes: their squares, by which light departs from linear, are 1 %."""
BORDER_SHARE = 0.15
"""Width of the film at rest around the ripples, and of its rise, over the frame's shorter side."""
LIFT_DEVIATIONS = 3.0
"""Mean height over the ripples' deviation: nearly all of the film is then above rest."""
SIMPSON_WEIGHTS = np.array([1, 4, 1]) / 6


class Ripples(NamedTuple):
    """A rippled film, the mean slope within every pixel, and the film at rest."""

    height: Height
    slope: Slope
    flat: Light


@node
def draw_ripples(
    *,
    calibration: Path,
    count: Annotated[int, Interval(ge=1, le=1000)] = 2,
    seed: Annotated[int, Interval(ge=0)] = 0,
) -> Iterator[Ripples]:
    """Yield films whose slopes have the same power at all frequencies and directions.

    They are drawn on half pixels: heights are those at the pixels' middles, slopes the means
    over their areas, by the heights of opposite edges.

    Parameters
    ----------
    calibration : gives frame, pixel and film at rest
    count, seed : how many; the same for the same seed
    """
    sensor, rng = certified_sensor(calibration), np.random.default_rng(seed)
    for _ in range(count):
        fine = _rippled(rng, sensor.flat.shape[1:], sensor.pixel)
        yield Ripples(*_by_pixel(fine, sensor.pixel), sensor.flat)


def _rippled(rng: np.random.Generator, size: tuple[int, ...], pixel: float) -> F8:
    """The heights at edges and middles of pixels, 2 H + 1 x 2 W + 1 in mm."""
    rows, columns = (2 * side + 1 for side in size)
    u, v = np.fft.rfftfreq(columns), np.fft.fftfreq(rows)[:, None]
    cycles = np.hypot(u, v)  # per half pixel
    resolved = (cycles > 2 / min(rows, columns)) & (cycles <= 1 / 4)
    wave = np.where(resolved, 1 / np.maximum(cycles, 1e-12), 0.0)
    height = np.fft.irfft2(
        np.fft.rfft2(rng.standard_normal((rows, columns))) * wave, s=(rows, columns)
    )
    slopes = np.gradient(height, pixel / 2)
    height *= RIPPLE_SLOPE / np.sqrt(np.mean([np.square(slope).mean() for slope in slopes]))
    away = np.minimum.outer(_to_border(rows), _to_border(columns)) / (
        BORDER_SHARE * min(rows, columns)
    )
    rise = np.clip(away - 1, 0, 1)
    taper = rise * rise * (3 - 2 * rise)
    return np.asarray(taper * (height + LIFT_DEVIATIONS * height.std()))


def _to_border(count: int) -> F8:
    places = np.arange(count, dtype=np.float64)
    return np.minimum(places, count - 1 - places)


def _by_pixel(fine: F8, pixel: float) -> tuple[Height, Slope]:
    def edges(lines: F8) -> F8:
        """The mean along each pixel's side (Simpson), at every line of edges."""
        along = (
            SIMPSON_WEIGHTS[0] * (lines[:, :-2:2] + lines[:, 2::2])
            + SIMPSON_WEIGHTS[1] * lines[:, 1::2]
        )
        return np.asarray(np.diff(along[::2], axis=0) / pixel)

    slope = np.stack([edges(fine.T).T, edges(fine)])
    return fine[1::2, 1::2].astype(np.float32), slope.astype(np.float32)
