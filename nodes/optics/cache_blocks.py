"""Long chains of array operations, on as many pixels at a time as fit into the cache."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from tactograph.graph.cores import cores

T = TypeVar("T")

BLOCK_PIXELS = 32768
"""Pixels of a block: few enough for the cache, many enough to hide the cost of calling NumPy."""


def in_blocks(work: Callable[[slice], T], count: int, pixels: int = 1) -> list[T]:
    """Call `work` for slices that cover `count`, on all cores, and return what it returns.

    Each counted item has `pixels` pixels: a row has as many as there are columns.  NumPy
    releases the interpreter's lock during an operation, so threads help.
    """
    step = max(1, BLOCK_PIXELS // pixels)
    blocks = [slice(first, min(first + step, count)) for first in range(0, count, step)]
    if len(blocks) == 1:
        return [work(blocks[0])]
    with ThreadPoolExecutor(cores()) as threads:
        return list(threads.map(work, blocks))
