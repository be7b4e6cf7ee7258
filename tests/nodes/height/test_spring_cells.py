"""Networks of springs on cells of 2 x 2 pixels."""

import numpy as np
import pytest

from tactograph.nodes import F4
from tactograph.nodes.height.spring_cells import cells_of
from tactograph.nodes.height.springs import Springs, Ties, conjugate_gradients, hierarchy

NO_TIES = Ties(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0, np.float32))


def network(shape: tuple[int, int], ties: Ties = NO_TIES) -> Springs:
    """Springs of uneven stiffness between pixels; those at the border are held."""
    rng = np.random.default_rng(3)
    rows, columns = shape
    right = rng.uniform(0.5, 2, (rows, columns - 1)).astype(np.float32)
    down = rng.uniform(0.5, 2, (rows - 1, columns)).astype(np.float32)
    ground = np.full(shape, 1e5, np.float32)
    ground[2:-2, 2:-2] = 0
    return Springs(right, down, ground, ties)


def solved(springs: Springs, wants: tuple[F4, F4, F4]) -> F4:
    start = np.zeros(springs.shape, np.float32)
    return conjugate_gradients(hierarchy(springs), springs.pull(*wants), start, 60, 0.0)


@pytest.mark.parametrize("shape", [(64, 80), (61, 83)])
def test_cells_move_as_their_pixels_do(shape: tuple[int, int]) -> None:
    """For a smooth load; blocks that are rigid move half as far."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    bump = np.exp(-((x - 40) ** 2 + (y - 30) ** 2) / 200).astype(np.float32)
    springs = network(shape)
    wants = np.diff(bump, axis=1), np.diff(bump, axis=0), np.zeros(0, np.float32)
    fine = solved(springs, wants)
    cells = cells_of(springs)
    found = cells.on_pixels(solved(cells.springs, cells.wants(*wants)))
    assert fine.max() > 0.9
    assert np.abs(found - fine).max() < 0.04


def test_ties_lift_cells_as_they_lift_pixels() -> None:
    tops, feet = (np.array([y * 80 + x for y in range(24, 32)]) for x in (40, 20))
    ties = Ties(tops, feet, np.full(8, 50, np.float32))
    springs = network((64, 80), ties)
    level = np.zeros((64, 79), np.float32), np.zeros((63, 80), np.float32)
    wants = *level, np.ones(8, np.float32)
    cells = cells_of(springs)
    assert cells.springs.ties.stiffness == pytest.approx(100)
    fine, found = (
        solved(springs, wants),
        cells.on_pixels(solved(cells.springs, cells.wants(*wants))),
    )
    rises = [z.ravel()[tops] - z.ravel()[feet] for z in (fine, found)]
    assert rises[1] == pytest.approx(rises[0], rel=0.2)
