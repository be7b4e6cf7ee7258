"""The cores that this process may use, as one of several workers."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

CORES_VARIABLE = "TACTOGRAPH_CORES"
"""The environment variable that limits the cores of a process."""
LIBRARY_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "POCL_MAX_PTHREAD_COUNT",
    "POCL_CPU_MAX_CU_COUNT",
)
"""The variables that limit the threads of libraries and of PoCL."""


def cores() -> int:
    """The number of cores that this process may use: those it is bound to, or its share."""
    setting = os.environ.get(CORES_VARIABLE, "")
    if setting.isdecimal() and int(setting) > 0:
        return min(int(setting), _bound_to())
    return _bound_to()


def share_of(workers: int) -> dict[str, str]:
    """The environment of a worker that gets its share of this process' cores.

    Variables that the user has set keep their values.
    """
    share = str(max(1, cores() // workers))
    return {**dict.fromkeys(LIBRARY_VARIABLES, share), **os.environ, CORES_VARIABLE: share}


@contextmanager
def environment(values: Mapping[str, str]) -> Iterator[None]:
    """Give these variables to the processes that are started inside the block."""
    before = dict(os.environ)
    take_over(values)
    try:
        yield
    finally:
        take_over(before)


def take_over(values: Mapping[str, str]) -> None:
    """Replace the environment."""
    for name in {*os.environ} - {*values}:
        del os.environ[name]
    os.environ.update(values)


def _bound_to() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # neither macOS nor Windows binds processes
        return os.cpu_count() or 1
