"""How many threads are worth starting: cores that this process may use, shared with its kin."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

OURS = "TACTOGRAPH_CORES"
"""The environment variable that says how many cores a process is to use."""
OTHERS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "POCL_MAX_PTHREAD_COUNT",
    "POCL_CPU_MAX_CU_COUNT",
)
"""The variables by which libraries and PoCL learn the same."""


def cores() -> int:
    """How many cores this process may use: those it is bound to, or its share of them."""
    told = os.environ.get(OURS, "")
    if told.isdecimal() and int(told) > 0:
        return min(int(told), _bound_to())
    return _bound_to()


@contextmanager
def shared_among(workers: int) -> Iterator[None]:
    """Give processes that are started inside the block an equal share of the cores each.

    A variable that the user has set keeps its value.
    """
    share = str(max(1, cores() // workers))
    new = {name: share for name in OTHERS if name not in os.environ}
    before = os.environ.get(OURS)
    os.environ.update(new, **{OURS: share})
    try:
        yield
    finally:
        for name in new:
            os.environ.pop(name, None)
        if before is None:
            os.environ.pop(OURS, None)
        else:
            os.environ[OURS] = before


def _bound_to() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # neither macOS nor Windows binds processes
        return os.cpu_count() or 1
