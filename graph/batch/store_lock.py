"""One batch at a time in a store."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tactograph.graph.disk.folder_lock import lock_folder
from tactograph.graph.errors import InputError


@contextmanager
def alone_in(place: str) -> Iterator[None]:
    """Keep other batches out of a store inside the block, where folders can be locked.

    Two that add captures, or merge into one chunk, would undo each other's work.

    Raises InputError if another batch is at work there, or its folder cannot be made.
    """
    try:
        Path(place).mkdir(parents=True, exist_ok=True)
        lock = lock_folder(Path(place))
    except BlockingIOError:
        raise InputError(
            f"{place}: another batch is at work in it; wait until it is done"
        ) from None
    except OSError as error:
        raise InputError(f"{place}: cannot be made: {error.strerror or error}") from None
    try:
        yield
    finally:
        if lock is not None:
            os.close(lock)
        with suppress(OSError):  # nothing came into it
            Path(place).rmdir()
