"""Long chains of array operations, so many pixels at a time that the cache holds them."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")

BLOCK = 32768
"""Pixels of a block: few for the cache, many against the cost of calling NumPy."""


def in_blocks(work: Callable[[slice], T], count: int) -> list[T]:
    """Call `work` for slices that cover `count` pixels, on all cores, and return what it returns.

    NumPy lets go of the interpreter during an operation, so that threads help.
    """
    blocks = [slice(first, min(first + BLOCK, count)) for first in range(0, count, BLOCK)]
    if len(blocks) == 1:
        return [work(blocks[0])]
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        return list(threads.map(work, blocks))
