"""The look-up against a search of all entries, in float32 as it is told."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from numpy.typing import NDArray

from tactograph.nodes import F4, U1
from tactograph.nodes.slope.index_lut import index_lut
from tactograph.nodes.slope.lut_nearest import lut_nearest


def of_all(
    light: F4, shadow: U1, tables: tuple[F4, F4, U1], number: int, neighbours: int
) -> tuple[NDArray[np.bool_], F4]:
    """The pixels that one table is for, and the mean slope of what is nearest in it."""
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
    nearest = order[np.argsort(squares, axis=0, kind="stable")[:neighbours]]
    total = np.zeros((pixels.shape[1], 2), np.float32)
    for each in nearest:
        total += slopes[each]
    return mine, (total / np.float32(len(nearest))).T


@pytest.mark.parametrize("neighbours", [1, 2, 16])
@pytest.mark.parametrize("values", [5, 1000], ids=["many ties", "few ties"])
@pytest.mark.parametrize(("lights", "count"), [(4, 5), (4, 700), (4, 6000), (5, 3000), (8, 700)])
def test_what_is_found_is_what_a_search_of_all_entries_finds(
    lights: int, count: int, values: int, neighbours: int
) -> None:
    rng = np.random.default_rng(count)
    entries = np.unique(rng.integers(0, values, (count, lights)), axis=0).astype(np.float32)
    entries = entries[rng.permutation(len(entries))] / np.float32(values)
    slopes = rng.uniform(-2, 2, (len(entries), 2)).astype(np.float32)
    tables = entries, slopes, np.full(len(entries), (1 << lights) - 1, np.uint8)
    light = rng.integers(-values, 4 * values, (lights, 50, 70)).astype(np.float32) / (2 * values)
    light[0, 0, :4] = np.nan, np.inf, -np.inf, 1e20
    none = np.zeros((50, 70), np.uint8)
    found = lut_nearest(light, none, index_lut(*tables), neighbours=neighbours)
    _, wanted = of_all(light, none, tables, 0, neighbours)
    assert np.array_equal(found.reshape(2, -1), wanted)


def test_a_shadowed_pixel_finds_what_is_nearest_without_its_led() -> None:
    rng = np.random.default_rng(3)
    entries = rng.random((3000, 4)).astype(np.float32)
    slopes = rng.uniform(-2, 2, (3000, 2)).astype(np.float32)
    lit = np.where(rng.random(3000) < 0.5, 15 & ~(1 << rng.integers(0, 4, 3000)), 15)
    tables = entries, slopes, lit.astype(np.uint8)
    light = rng.random((4, 50, 70)).astype(np.float32)
    shadow = rng.integers(0, 16, (50, 70)).astype(np.uint8)
    found = lut_nearest(light, shadow, index_lut(*tables)).reshape(2, -1)
    for number in range(5):
        mine, wanted = of_all(light, shadow, tables, number, 1)
        assert mine.any()
        assert np.array_equal(found[:, mine], wanted)


def test_a_device_does_not_wait_for_the_hosts_compiler() -> None:
    code = "import sys, tactograph.nodes.slope.lut_nearest; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
