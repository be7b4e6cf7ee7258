"""How many processes a batch is worth."""

from __future__ import annotations

from collections.abc import Sequence

from tactograph.graph.backends.device_backend import open_device
from tactograph.graph.run.cores import cores

MIN_CAPTURES_PER_PROCESS = 256
"""Captures that make up for the start of a process, which takes a second."""


def worker_count(backends: Sequence[str], device: str | None, captures: int) -> int:
    """How many processes do so many captures soonest, of a graph that prefers these back ends.

    One for each core: each does more by itself than with a share of all.  A GPU has one.

    Raises
    ------
    InputError
        If `device` is the name of none that works.
    """
    opened = open_device(backends, device)[0]
    if opened is not None and not opened.is_cpu:
        return 1
    return at_most(captures)


def at_most(captures: int) -> int:
    """How many that can be, whatever the graph."""
    return max(1, min(cores(), captures // MIN_CAPTURES_PER_PROCESS))
