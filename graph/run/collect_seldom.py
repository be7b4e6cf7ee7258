"""How often a process of its own looks for garbage: seldom, and not as it ends."""

from __future__ import annotations

import atexit
import gc

YOUNG_THRESHOLD, MIDDLE_THRESHOLD = 10_000, 50
"""So many objects more than before, and the youngest are looked through; so often, the next older.

Python's own are 700 and 10.  Of the objects that imports make none is garbage, and to look for it
takes a seventh of their time.
"""


def collect_seldom() -> None:
    """Look for garbage less often, in this process and in those that it forks."""
    gc.set_threshold(YOUNG_THRESHOLD, MIDDLE_THRESHOLD)
    # A process that ends gives back all at once.
    atexit.register(gc.freeze)
