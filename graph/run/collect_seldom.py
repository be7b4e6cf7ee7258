"""Collect garbage seldom, and not at exit, in a process that the command line owns."""

import atexit
import gc

YOUNG_THRESHOLD, MIDDLE_THRESHOLD = 10_000, 50
"""Allocations that start a collection of the young, and such collections that start the next.

Python's defaults are 700 and 10.  Imports make no garbage, but searching for it takes a seventh of
their time.
"""


def collect_seldom() -> None:
    """Collect garbage less often, in this process and in those that it forks."""
    gc.set_threshold(YOUNG_THRESHOLD, MIDDLE_THRESHOLD)
    # At exit the system frees all memory at once.
    atexit.register(gc.freeze)
