"""Garbage collection in a process of our own: seldom, and not at its end."""

import atexit
import gc

YOUNG_THRESHOLD, MIDDLE_THRESHOLD = 10_000, 50
"""Allocations before a collection of the youngest objects, and those collections before the next.

Python's own thresholds are 700 and 10.  Imports make no garbage, but searching for it takes a
seventh of their time.
"""


def collect_seldom() -> None:
    """Collect garbage less often, in this process and in those that it forks."""
    gc.set_threshold(YOUNG_THRESHOLD, MIDDLE_THRESHOLD)
    # At its end a process frees all memory at once.
    atexit.register(gc.freeze)
