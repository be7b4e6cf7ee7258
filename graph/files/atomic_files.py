"""Files appear whole or not at all: written beside their place, then moved there."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tactograph.graph.errors import InputError, WriteError
from tactograph.graph.files.text_names import refuse_other_names


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path with the same suffix; move it to `path` if the block succeeds.

    Raises
    ------
    WriteError
        If `path` cannot be written.
    InputError
        If its name is not UTF-8, or the block could not read a file from elsewhere.
    """
    refuse_other_names(path)
    _refuse_special(path)
    with atomic_files(path.parent) as folder:
        yield folder / path.name


@contextmanager
def atomic_files(folder: Path) -> Iterator[Path]:
    """Yield a temporary folder; move every file in it to `folder` if the block succeeds.

    Raises
    ------
    WriteError
        If `folder` cannot be made or written.
    InputError
        If its name is not UTF-8, or the block could not read a file from elsewhere.
    """
    refuse_other_names(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=".writing-", dir=folder))
    except OSError as error:
        raise WriteError(f"{folder}: cannot be written: {error.strerror or error}") from None
    try:
        yield stage
        files = sorted(stage.iterdir())
        for file in files:
            _refuse_special(folder / file.name)
        for file in files:
            file.replace(folder / file.name)
    except OSError as error:
        if _is_elsewhere(error, folder):
            raise InputError(f"{error.filename}: {error.strerror or error}") from None
        raise WriteError(f"{folder}: cannot be written: {error.strerror or error}") from None
    finally:
        shutil.rmtree(stage, ignore_errors=True)


def _refuse_special(path: Path) -> None:
    """Refuse to put a file in the place of a folder, a device or a pipe."""
    if path.exists() and not path.is_file():
        kind = "a folder" if path.is_dir() else "a device or a pipe"
        raise WriteError(
            f"{path.parent}: cannot be written: {path.name} is {kind}; give another place"
        )


def _is_elsewhere(error: OSError, folder: Path) -> bool:
    """Whether it was another file that failed, one that the block reads."""
    if not isinstance(error.filename, str):
        return False
    return not Path(error.filename).absolute().is_relative_to(folder.absolute())
