"""Long chains of array operations, so many pixels at a time that the cache holds them."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from tactograph.graph.run.cores import cores

T = TypeVar("T")

BLOCK = 32768
"""Pixels of a block: few for the cache, many against the cost of calling NumPy."""


def in_blocks(work: Callable[[slice], T], count: int, pixels: int = 1) -> list[T]:
    """Call `work` for slices that cover `count`, on all cores, and return what it returns.

    What is counted has so many `pixels` each: rows have as many as there are columns.  NumPy
    lets go of the interpreter during an operation, so that threads help.
    """
    step = max(1, BLOCK // pixels)
    blocks = [slice(first, min(first + step, count)) for first in range(0, count, step)]
    if len(blocks) == 1:
        return [work(blocks[0])]
    with ThreadPoolExecutor(cores()) as threads:
        return list(threads.map(work, blocks))
