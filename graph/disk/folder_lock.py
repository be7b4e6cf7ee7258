"""Locks on folders, which end with the process that holds them."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tactograph.graph.errors import InputError


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


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Make a folder and lock it inside the block; if nothing comes into it, it is removed.

    Raises InputError if another process holds the lock, or the folder cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = lock_folder(folder)
    except BlockingIOError:
        raise InputError(f"{folder}: another process is at work in it; wait for its end") from None
    except OSError as error:
        raise InputError(f"{folder}: cannot be made: {error.strerror or error}") from None
    try:
        yield
    finally:
        if lock is not None:
            os.close(lock)
        with suppress(OSError):
            folder.rmdir()
