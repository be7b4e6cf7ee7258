"""The normal equations of a small rigid motion of a surface, summed over blocks of cells."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from annotated_types import Interval

from tactograph.graph import Close, Parts, Port, node
from tactograph.nodes import F4, Height, Mask

CAUCHY_SIGMAS = np.float32(2.4)
"""Standard deviations beyond which a difference loses weight (Cauchy)."""
AT_GRADIENT, AT_PAIRS, AT_ACROSS, AT_DOWN = 21, 27, 30, 33
"""Places among the sums: A's upper half by rows; g; of the pairs' slopes the weights, weighted
squares and squares; for pairs across, and for those down, how many there are, and values and
squares of the surface's own slopes."""
Steepness = Annotated[F4, Port("2 H W", "1", low=-3, high=3)]
"""-dz/dx and -dz/dy."""
SurfaceTerms = Annotated[F4, Port("6", "mm, 1")]
"""Side of a cell, x and y of the first cell in mm; the third part of m (R1), 1 for a surface, 0
for its noise; the standard deviation of a difference's slope; the weight of a height."""
BlockSums = Annotated[F4, Port("h w 36", "mm, 1")]
"""Sums by block, see `AT_GRADIENT`."""
UPPER_HALF = np.triu_indices(6)


@node(
    derived={"h": Parts("H", by="block"), "w": Parts("W", by="block")},
    tolerance=Close(1e-3, 1e-4, why="sums in another order"),
)
def motion_equations(
    height: Height,
    steepness: Steepness,
    residual: Height,
    seen: Mask,
    terms: SurfaceTerms,
    *,
    block: Annotated[int, Interval(ge=1, le=64)] = 8,
) -> BlockSums:
    """Sum A and g of A d = g for the small motion d that leaves least of the residual.

    A motion v = t + w x X changes the height at a fixed place by v . m (R1); so the six columns
    of the Jacobian are planes.  What is squared are the slopes between cells that are seen and
    their neighbours right and below, of the residual less the Jacobian times d, at a weight that
    falls for large ones (Cauchy), and with little weight the heights.

    Parameters
    ----------
    height
        H x W in mm, the surface on cells.
    steepness
        2 x H x W, of the same surface, or of what is to be moved with it.
    residual
        H x W in mm, what the motion has to explain.
    seen
        H x W, the cells that count.
    terms
        Six numbers, see `SurfaceTerms`.
    block
        Side in cells of the blocks whose sums are kept apart.

    Returns
    -------
    ndarray
        h x w x 36, sums by block.
    """
    side, left, top, up, level, weight_of_height = terms
    rows, columns = height.shape
    x = np.broadcast_to(left + side * np.arange(columns, dtype=np.float32), height.shape)
    y = np.broadcast_to(top + side * np.arange(rows, dtype=np.float32)[:, None], height.shape)
    (a, b), c = steepness, np.full_like(height, up)
    jacobian = [a, b, c, y * c - height * b, height * a - x * c, x * b - y * a]
    told = np.stack([*jacobian, residual, height])
    inside = (seen > 0).astype(np.float32)
    across, down = np.zeros_like(told), np.zeros_like(told)
    across[..., :-1] = np.diff(told) / side * (inside[:, :-1] * inside[:, 1:])
    down[:, :-1] = np.diff(told, axis=1) / side * (inside[:-1] * inside[1:])
    pairs = np.zeros((2, rows, columns), np.float32)
    pairs[0, :, :-1], pairs[1, :-1] = inside[:, :-1] * inside[:, 1:], inside[:-1] * inside[1:]
    slope, rise = np.stack([across[6:], down[6:]], axis=1)
    weight = pairs / (1 + (slope / (CAUCHY_SIGMAS * level)) ** 2)
    weights = np.stack([weight_of_height * inside, *weight])
    places = np.stack([told[:7], across[:7], down[:7]])
    one = _blocks(places, block)
    products = np.sum((_blocks(weights[:, None], block) * one) @ one.swapaxes(-1, -2), 2)
    own = np.stack([pairs, rise, rise**2], axis=1).reshape(6, rows, columns)
    plain = np.stack([*(np.sum([weight, weight * slope**2, slope**2], axis=1)), *own])
    return np.concatenate(
        [
            products[..., UPPER_HALF[0], UPPER_HALF[1]],
            products[..., :6, 6],
            _blocks(plain[None], block)[:, :, 0].sum(axis=-1),
        ],
        axis=-1,
    )


def _blocks(planes: F4, side: int) -> F4:
    """N x P x H x W as h x w x N x P x cells of a block; zero beyond the border."""
    count, each, rows, columns = planes.shape
    whole = np.pad(planes, ((0, 0), (0, 0), (0, -rows % side), (0, -columns % side)))
    down, across = whole.shape[2] // side, whole.shape[3] // side
    split = whole.reshape(count, each, down, side, across, side)
    return split.transpose(2, 4, 0, 1, 3, 5).reshape(down, across, count, each, side * side)


motion_equations.opencl(grid="h w")


@motion_equations.example
def _example(rng: np.random.Generator, H: int, W: int, **_: int) -> dict[str, Any]:
    """A surface near the middle, and a weight of heights that counts."""
    terms = [0.1, *rng.uniform(-2, 0, 2), rng.integers(0, 2), rng.uniform(0.01, 1), 0.1]
    return {"terms": np.array(terms, np.float32)}
