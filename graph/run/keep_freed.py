"""Let the process keep freed memory, for the arrays of the next node."""

import ctypes
import os

import numpy as np

# Windows cannot open the running program as a library.
_C_LIBRARY = ctypes.CDLL(None) if os.name == "posix" else None
MAX_REUSED_BYTES = 2**24
"""Largest array whose memory is reused."""


def keep_freed() -> None:
    """Have the C library keep memory that nodes free, up to twice `MAX_REUSED_BYTES`.

    glibc returns the memory of large arrays to the system, which hands it out again page by page,
    zeroed: half of the time of a chain of array operations on an image.  The limit of "large"
    follows the largest array that was freed (``mallopt(3)``, ``M_MMAP_THRESHOLD``).  Other C
    libraries ignore this.
    """
    np.empty(MAX_REUSED_BYTES, np.uint8)


def give_back() -> None:
    """Return freed memory to the system, since fragments between used blocks are never reused.

    Without it, loading a graph for a device again and again costs up to 2 MB a load.
    """
    if trim := getattr(_C_LIBRARY, "malloc_trim", None):
        trim(0)
