"""Locks on folders, which end with the process that holds them."""

import os
from pathlib import Path


def lock_folder(folder: Path) -> int | None:
    """Lock a folder as long as the returned file descriptor stays open.

    Returns None if folders cannot be locked, as on Windows and some file systems.  Raises
    BlockingIOError if another process holds the lock; OSError if the folder cannot be opened.
    """
    try:
        import fcntl
    except ImportError:
        return None
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        if isinstance(error, BlockingIOError):
            raise
        return None
    return descriptor
