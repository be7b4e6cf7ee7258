"""The cores that this process may use, as one of several workers."""

import os

CORES_VARIABLE = "TACTOGRAPH_CORES"
"""The environment variable that limits the cores of a process."""


def cores(at_most: int | None = None) -> int:
    """The number of cores that this process may use: its share, or those it is bound to.

    A share `at_most` counts from now on, and for the processes that it starts.
    """
    if at_most is not None:
        os.environ[CORES_VARIABLE] = str(at_most)
    setting = os.environ.get(CORES_VARIABLE, "")
    if setting.isdecimal() and int(setting) > 0:
        return min(int(setting), _bound_to())
    return _bound_to()


def _bound_to() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # neither macOS nor Windows binds processes
        return os.cpu_count() or 1
