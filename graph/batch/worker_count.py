"""The number of processes for a batch."""

from collections.abc import Sequence

from tactograph.graph.backends.device_backend import open_device
from tactograph.graph.cores import cores

MIN_CAPTURES_PER_PROCESS = 256
"""Captures that justify the start of a process, which takes a second."""


def worker_count(backends: Sequence[str], device: str | None, captures: int) -> int:
    """The number of processes that finish soonest, for a graph that prefers these back ends.

    It is one for each core, since separate processes outrun shared threads, and one for a GPU.

    Raises InputError if `device` names no device that works.
    """
    opened = open_device(backends, device)[0]
    if opened is not None and not opened.is_cpu:
        return 1
    return at_most(captures)


def at_most(captures: int) -> int:
    """The upper limit of that, for any graph."""
    return max(1, min(cores(), captures // MIN_CAPTURES_PER_PROCESS))
