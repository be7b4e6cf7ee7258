"""Measure how much of the camera's noise pixels have in common with their neighbours."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import node
from tactograph.nodes import F4, Grain, Light, Noise, NoiseCorrelation
from tactograph.nodes.calibrate._immerkaer import responses, variances
from tactograph.nodes.calibrate.estimate_noise import LEVELS
from tactograph.nodes.capture._sheet import SheetLight, cut
from tactograph.nodes.light.coarsen import coarsen
from tactograph.nodes.light.flat_field import flat_field
from tactograph.nodes.light.light_noise import light_noise

TILE = 32
"""Pixels along the side of a tile of film."""
MOST_TILES, FEWEST_TILES = 400, 24
"""So many are looked at in a press under an LED; of fewer in all, nothing is said."""
CALM, AS_CALM = 0.1, 0.65
"""Share of the tiles in which nothing but noise differs from cell to cell, at least; and what the
calmest show of white noise of variance 1."""
CELL, APART = 4, 2
"""Pixels along the side of a cell, and cells from one compared to the next."""
MOST = 4.0
"""As much as these cells show of a mosaic that has a colour in every fourth pixel; what differs
more is film."""
LEAST = 1e-12
"""Variance that is divided by."""


@node
def noise_correlation(
    image: SheetLight, flat: Light, noise: Noise, grain: Grain
) -> NoiseCorrelation:
    """Return how many times more variance a mean over pixels has than independent noise leaves.

    Where a camera interpolates colours, or compresses, neighbours err alike.  A mean over them
    then takes less of the noise away, and a mask that compares neighbours hardly sees it
    (`estimate_noise`).  The square of the noise correlation ratio of Fruchter and Hook ("Drizzle:
    a method for the linear reconstruction of undersampled images", 2002), from means of 4 x 4
    pixels, on calm film.  A film that settles with another texture after every touch counts as
    noise, as far as its grain does not tell of it.

    Parameters
    ----------
    image
        K x S x W, as captured: one capture, or presses on a sheet (`_sheet`).
    flat
        K x H x W, the film at rest.
    noise
        (shot, read), as `estimate_noise` gives it.
    grain
        Of the film; with the noise it is what a pixel is taken to err by.

    Returns
    -------
    float
        1 where every pixel has noise of its own.
    """
    if min(flat.shape[1:]) < TILE:
        return 1.0
    black = np.zeros(flat.shape[1:], np.float32)
    ratios = []
    for press in cut(image, flat.shape[1]):
        light, sigma = flat_field(press, flat, black), light_noise(press, flat, noise)
        for seen, relative, camera in zip(press, light, sigma, strict=True):
            lit = _in_tiles((seen > LEVELS[0]) & (seen < LEVELS[-1]), TILE).all(axis=1)
            asked = np.flatnonzero(lit)[:: 1 + int(lit.sum()) // MOST_TILES]
            alone = camera**2 + (grain * relative) ** 2
            expected = _in_tiles(alone, TILE)[asked].mean(axis=1)
            ratios.append(_of_cells(relative)[asked] / np.maximum(expected, LEAST))
    found = np.concatenate(ratios)
    if found.size < FEWEST_TILES:
        return 1.0
    return float(np.clip(np.quantile(found, CALM) / AS_CALM, 1, MOST))


def _of_cells(light: F4) -> NDArray[Any]:
    """For each tile the variance of a pixel that would make cells as noisy as they are.

    The mask's taps are apart, since neighbouring cells share noise, too.
    """
    rows, columns = (size // TILE * TILE for size in light.shape)
    cells = coarsen(light[None, :rows, :columns], factor=CELL)[0]
    return variances(_in_tiles(responses(cells, APART), TILE // CELL)) * CELL**2


def _in_tiles(plane: NDArray[Any], side: int) -> NDArray[Any]:
    """N x side^2, by tile; what does not fill a tile at the right and bottom is left out."""
    rows, columns = (size // side for size in plane.shape)
    whole = plane[: rows * side, : columns * side].reshape(rows, side, columns, side)
    return whole.swapaxes(1, 2).reshape(rows * columns, side * side)
