"""The look-up agrees with a search of all entries in float32."""

import numpy as np
import pytest
from numpy.typing import NDArray

from tactograph.nodes import F4, U1
from tactograph.nodes.slope.index_lut import index_lut
from tactograph.nodes.slope.lut_nearest import lut_nearest


def of_all(
    light: F4, shadow: U1, tables: tuple[F4, F4, U1], number: int
) -> tuple[NDArray[np.bool_], F4]:
    """The pixels of one table, and the slope of the nearest entry in it."""
    entries, slopes, lit = tables
    count, led = len(light), number - 1
    tame = np.clip(np.nan_to_num(light.reshape(count, -1)), -1e15, 1e15)
    bits = shadow.ravel() >> np.arange(count)[:, None] & 1
    darkest = np.where(bits, tame, np.inf).argmin(axis=0)
    mine = np.where(bits.any(axis=0), darkest + 1, 0) == number
    every = (1 << count) - 1
    chosen = (lit | (1 << led if number else 0)) == every
    entries, slopes, pixels = entries[chosen].copy(), slopes[chosen], tame[:, mine]
    if number:
        entries[:, led], pixels[led] = 0, 0
    order = np.lexsort(entries.T[::-1])
    squares = np.zeros((len(order), pixels.shape[1]), np.float32)
    for k in range(count):
        squares += (entries[order, k, None] - pixels[k]) ** 2
    return mine, slopes[order[squares.argmin(axis=0)]].T


@pytest.mark.one_case
@pytest.mark.parametrize(("lights", "count"), [(4, 5), (4, 700), (4, 6000), (5, 3000), (8, 700)])
def test_the_entry_found_is_that_of_a_search_of_all_entries(lights: int, count: int) -> None:
    rng = np.random.default_rng(count)
    entries = rng.random((count, lights)).astype(np.float32)
    slopes = rng.uniform(-2, 2, (count, 2)).astype(np.float32)
    tables = entries, slopes, np.full(count, (1 << lights) - 1, np.uint8)
    light = rng.uniform(-0.5, 2, (lights, 50, 70)).astype(np.float32)
    light[0, 0, 0] = np.nan
    none = np.zeros((50, 70), np.uint8)
    found = lut_nearest(light, none, index_lut(*tables))
    _, wanted = of_all(light, none, tables, 0)
    np.testing.assert_allclose(found.reshape(2, -1), wanted, atol=1e-6)


def test_of_equally_near_entries_one_is_found() -> None:
    rng = np.random.default_rng(5)
    entries = np.unique(rng.integers(0, 5, (3000, 4)), axis=0).astype(np.float32) / 4
    slopes = rng.uniform(-2, 2, (len(entries), 2)).astype(np.float32)
    light = rng.integers(0, 9, (4, 50, 70)).astype(np.float32) / 8
    index = index_lut(entries, slopes, np.full(len(entries), 15, np.uint8))
    found = lut_nearest(light, np.zeros((50, 70), np.uint8), index).reshape(2, -1).T
    away = np.square(entries[:, None] - light.reshape(4, -1).T).sum(axis=2)
    of = (slopes[:, None] == found).all(axis=2).argmax(axis=0)
    assert (slopes[of] == found).all()
    assert (away[of, np.arange(len(of))] == away.min(axis=0)).all()


def test_a_shadowed_pixel_is_compared_without_its_led() -> None:
    rng = np.random.default_rng(3)
    entries = rng.random((3000, 4)).astype(np.float32)
    slopes = rng.uniform(-2, 2, (3000, 2)).astype(np.float32)
    lit = np.where(rng.random(3000) < 0.5, 15 & ~(1 << rng.integers(0, 4, 3000)), 15)
    tables = entries, slopes, lit.astype(np.uint8)
    light = rng.random((4, 50, 70)).astype(np.float32)
    shadow = rng.integers(0, 16, (50, 70)).astype(np.uint8)
    found = lut_nearest(light, shadow, index_lut(*tables)).reshape(2, -1)
    for number in range(5):
        mine, wanted = of_all(light, shadow, tables, number)
        assert mine.any()
        assert np.array_equal(found[:, mine], wanted)
