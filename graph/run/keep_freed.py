"""Freed memory stays with the process, for the arrays of the next node."""

import ctypes
import os

import numpy as np

# Windows has no library by no name.
_C_LIBRARY = ctypes.CDLL(None) if os.name == "posix" else None
MAX_REUSED_BYTES = 2**24
"""Largest array whose memory is reused."""


def keep_freed() -> None:
    """Have the C library keep memory that nodes free, up to twice `MAX_REUSED_BYTES`.

    glibc gives the memory of large arrays back to the system, which hands it out again page by
    page, zeroed: half of the time of a chain of array operations on an image.  What counts as
    large follows the largest array that was freed (``mallopt(3)``, ``M_MMAP_THRESHOLD``).
    Other C libraries take no note.
    """
    np.empty(MAX_REUSED_BYTES, np.uint8)


def give_back() -> None:
    """Give freed memory back to the system: pieces of it between what is in use stay unused.

    Loading a graph again and again for a device so cost a process up to 2 MB a load.
    """
    if trim := getattr(_C_LIBRARY, "malloc_trim", None):
        trim(0)
