"""Run long chains of array operations on blocks of pixels that fit into the cache."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from tactograph.graph.cores import cores

T = TypeVar("T")

BLOCK_PIXELS = 32768
"""Pixels of a block: few enough for the cache, many enough to hide the cost of calling NumPy."""


def in_blocks(work: Callable[[slice], T], count: int, pixels: int = 1) -> list[T]:
    """Call `work` for slices that cover `count` items, on all cores, and return its results.

    Each item has `pixels` pixels; for a row that is the number of columns.  NumPy releases the
    interpreter's lock during an operation, so threads help.
    """
    step = max(1, BLOCK_PIXELS // pixels)
    blocks = [slice(first, min(first + step, count)) for first in range(0, count, step)]
    if len(blocks) == 1:
        return [work(blocks[0])]
    with ThreadPoolExecutor(cores()) as threads:
        return list(threads.map(work, blocks))
