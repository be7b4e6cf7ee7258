"""Atomic files: they are written beside their place, then moved, so none is ever incomplete."""

import os
import shutil
import tempfile
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tactograph.graph.disk.folder_lock import lock_folder
from tactograph.graph.disk.text_names import refuse_other_names
from tactograph.graph.errors import InputError, WriteError, full_disk

STAGE_PREFIX = ".writing-"
"""The start of temporary folders' names."""


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path with the same suffix; move it to `path` if the block succeeds.

    Raises WriteError if `path` cannot be written; InputError if its name is not UTF-8, or the block
    could not read another file.
    """
    with atomic_files(path.parent, target=path) as folder:
        yield folder / path.name


def write_file(path: Path, text: str) -> None:
    """Write text as one atomic file.  Raises the errors of `atomic_file`."""
    with atomic_file(path) as target:
        target.write_text(text, encoding="utf-8")


@contextmanager
def atomic_files(
    folder: Path, *, last: str = "", instead_of: Collection[str] = (), target: Path | None = None
) -> Iterator[Path]:
    """Yield a temporary folder; move every file in it to `folder` if the block succeeds.

    Errors name `target`, the one file that is written, or else `folder`.  New folders that stay
    empty are removed again.

    The file `last` lists the other files, and is moved after them.  Before that, files of
    `instead_of` that the block did not write are removed.  A kill leaves the temporary folder, and
    possibly a mixture of new and old files; the next write into `folder` removes the temporary
    folder.

    Raises WriteError if `folder` cannot be made or written; InputError if its name is not UTF-8, or
    if the block could not read another file.
    """
    refuse_other_names(target or folder)
    if target is not None:
        _refuse_special(target)
    place = target or (folder if folder.name else folder.absolute())
    new_folders: list[Path] = []
    try:
        new_folders += [each for each in (folder, *folder.parents) if not each.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        _remove_leftovers(folder)
        stage, lock = _new_stage(folder)
    except (FileExistsError, NotADirectoryError):
        reason = "a folder is needed, but a file has that name; give another place"
        raise _refusal(folder, reason) from None
    except OSError as error:
        _remove_empty(new_folders)
        raise _refusal(place, _reason(error, folder)) from None
    try:
        yield stage
        names = sorted(file.name for file in stage.iterdir())
        for name in names:
            _refuse_special(folder / name)
        for name in names:
            if name != last:
                (stage / name).replace(folder / name)
        for name in {*instead_of} - {*names}:
            (folder / name).unlink(missing_ok=True)
        if last in names:
            (stage / last).replace(folder / last)
    except OSError as error:
        place_named = Path(error.filename) if isinstance(error.filename, str) else folder
        if not place_named.absolute().is_relative_to(folder.absolute()):  # what the block reads
            raise InputError(f"{error.filename}: {error.strerror or error}") from None
        raise _refusal(place, _reason(error, folder)) from None
    finally:
        shutil.rmtree(stage, ignore_errors=True)
        if lock is not None:
            os.close(lock)
        _remove_empty(new_folders)


def _remove_empty(folders: Iterable[Path]) -> None:
    """Remove folders, innermost first, up to one that is not empty."""
    with suppress(OSError):
        for folder in folders:
            folder.rmdir()


def _reason(error: OSError, folder: Path) -> object:
    """Why writing into `folder` fails; a full disk is named by its mount point."""
    if not full_disk(error):
        return error.strerror or error
    around = (folder.absolute(), *folder.absolute().parents)
    disk = next(each for each in around if each.is_mount())
    return f"No space left on device, the disk of {disk}; make room, or give another place"


def _new_stage(folder: Path) -> tuple[Path, int | None]:
    """A temporary folder, and its lock if folders can be locked."""
    while True:
        stage = Path(tempfile.mkdtemp(prefix=STAGE_PREFIX, dir=folder))
        try:
            lock = lock_folder(stage)
        except (BlockingIOError, FileNotFoundError):
            continue  # another writer has taken it for a leftover
        if lock is None or stage.exists():
            return stage, lock
        os.close(lock)


def _remove_leftovers(folder: Path) -> None:
    """Remove temporary folders of killed writers, whose locks are free."""
    for stage in folder.glob(f"{STAGE_PREFIX}*"):
        with suppress(OSError):
            lock = lock_folder(stage)
            if lock is not None:
                shutil.rmtree(stage, ignore_errors=True)
                os.close(lock)


def _refuse_special(path: Path) -> None:
    """Refuse to put a file in the place of a folder, a device or a pipe."""
    try:
        is_special = path.exists() and not path.is_file()
    except OSError as error:  # a name that is too long
        raise _refusal(path, error.strerror or error) from None
    if is_special:
        kind = "a folder" if path.is_dir() else "a device or a pipe"
        raise _refusal(path.parent, f"{path.name} is {kind}; give another place")


def _refusal(place: Path, reason: object) -> WriteError:
    return WriteError(f"{place}: cannot be written: {reason}")
