"""Measure how strongly the camera's noise is correlated between neighbouring pixels."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import node
from tactograph.nodes import F4, Grain, Light, Noise, NoiseCorrelation
from tactograph.nodes.calibrate.rest._immerkaer import responses, variances
from tactograph.nodes.calibrate.rest.estimate_noise import LIGHT_LEVELS
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.light.flat_field import flat_field
from tactograph.nodes.light.light_noise import light_noise
from tactograph.nodes.optics.sheet import SheetLight, cut

TILE_PX = 32
"""Side of a tile of film in pixels."""
MAX_TILES, MIN_TILES = 400, 24
"""Approximate number of tiles per press and LED, and the smallest number in total for a result."""
CALM_SHARE, CALM_QUANTILE = 0.1, 0.65
"""Share of tiles in which cells surely differ by noise alone, and the value of this quantile for
white noise of variance 1."""
CELL_PX, CELL_DISTANCE = 4, 2
"""Side of a cell in px, and distance of the compared cells in cells."""
MAX_CORRELATION = 4.0
"""Largest result: that of a mosaic with each colour in every fourth pixel.  A larger value is due
to the film."""
MIN_VARIANCE = 1e-12
"""Lower bound on a variance in a denominator."""


@node
def noise_correlation(
    image: SheetLight, flat: Light, noise: Noise, grain: Grain
) -> NoiseCorrelation:
    """Return the variance of a mean over pixels, relative to that with independent noise.

    A camera that interpolates colours or compresses correlates the noise of neighbours.  A mean
    over them then removes less noise, and a mask that compares neighbours hardly sees it
    (`estimate_noise`).  The result is the square of the noise correlation ratio of Fruchter and
    Hook ("Drizzle: a method for the linear reconstruction of undersampled images", 2002), from
    means of 4 x 4 pixels on calm film.  The texture of a film that settles differently after
    every touch counts as noise, as far as `grain` does not include it.

    Parameters
    ----------
    image : K x S x W, as captured: one capture, or presses on a sheet (`sheet`)
    flat : K x H x W, the film at rest
    noise : (shot, read), a captured light I has the variance shot * I + read
    grain : of the film; together with the noise it is the expected standard deviation of a pixel

    Returns
    -------
    1 if the pixels' noise is independent.
    """
    if min(flat.shape[1:]) < TILE_PX:
        return 1.0
    black = np.zeros(flat.shape[1:], np.float32)
    ratios = []
    for press in cut(image, flat.shape[1]):
        for touched, rest in zip(press[:, None], flat[:, None], strict=True):
            (relative,), (camera,) = (
                flat_field(touched, rest, black),
                light_noise(touched, rest, noise),
            )
            is_lit = (touched[0] > LIGHT_LEVELS[0]) & (touched[0] < LIGHT_LEVELS[-1])
            lit = _in_tiles(is_lit, TILE_PX).all(axis=1)
            tiles = np.flatnonzero(lit)[:: 1 + int(lit.sum()) // MAX_TILES]
            alone = camera**2 + (grain * relative) ** 2
            expected = _in_tiles(alone, TILE_PX)[tiles].mean(axis=1)
            ratios.append(_of_cells(relative)[tiles] / np.maximum(expected, MIN_VARIANCE))
    ratios_of_tiles = np.concatenate(ratios)
    if ratios_of_tiles.size < MIN_TILES:
        return 1.0
    return float(
        np.clip(np.quantile(ratios_of_tiles, CALM_SHARE) / CALM_QUANTILE, 1, MAX_CORRELATION)
    )


def _of_cells(light: F4) -> NDArray[Any]:
    """The pixel variance that would explain the noise of the cells, for each tile.

    The mask's taps skip cells, since neighbouring cells share noise, too.
    """
    rows, columns = (size // TILE_PX * TILE_PX for size in light.shape)
    cells = coarsen(light[None, :rows, :columns], factor=CELL_PX)[0]
    return variances(_in_tiles(responses(cells, CELL_DISTANCE), TILE_PX // CELL_PX)) * CELL_PX**2


def _in_tiles(plane: NDArray[Any], side: int) -> NDArray[Any]:
    """N x side^2, by tile; incomplete tiles at the right and bottom are left out."""
    rows, columns = (size // side for size in plane.shape)
    whole = plane[: rows * side, : columns * side].reshape(rows, side, columns, side)
    return whole.swapaxes(1, 2).reshape(rows * columns, side * side)
