"""Files appear whole or not at all: written beside their place, then moved there."""

from __future__ import annotations

import errno
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tactograph.graph.errors import InputError, WriteError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path with the same suffix; move it to `path` if the block succeeds.

    Raises
    ------
    WriteError
        If `path` cannot be written.
    """
    with whole_files(path.parent) as folder:
        yield folder / path.name


@contextmanager
def whole_files(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder; move every file in it to `folder` if the block succeeds.

    Raises
    ------
    WriteError
        If `folder` cannot be made or written.
    InputError
        If the block could not read a file from elsewhere.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=".writing-", dir=folder))
    except OSError as error:
        raise WriteError(f"{folder}: cannot be written: {error.strerror or error}") from None
    try:
        yield stage
        files = sorted(stage.iterdir())
        for file in files:
            if (folder / file.name).is_dir():
                raise IsADirectoryError(errno.EISDIR, f"{file.name} is a folder")
        for file in files:
            file.replace(folder / file.name)
    except OSError as error:
        if _is_elsewhere(error, folder):
            raise InputError(f"{error.filename}: {error.strerror or error}") from None
        raise WriteError(f"{folder}: cannot be written: {error.strerror or error}") from None
    finally:
        shutil.rmtree(stage, ignore_errors=True)


def _is_elsewhere(error: OSError, folder: Path) -> bool:
    """Whether it was another file that failed, one that the block reads."""
    if not isinstance(error.filename, str):
        return False
    return not Path(error.filename).absolute().is_relative_to(folder.absolute())
