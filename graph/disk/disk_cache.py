"""A cache on disk, for later processes; its files may be removed at any time.

A file is written beside its place and moved there, so that two writers or a kill leave complete
files.  Its content is checked when it is read.  If a folder is too large, the least recently read
files are removed.
"""

import hashlib
import os
import zlib
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import platformdirs

from tactograph.graph.disk.atomic_files import atomic_file
from tactograph.graph.errors import InputError

FOLDER_VARIABLE = "TACTOGRAPH_CACHE"
"""The environment variable that sets another folder, or ``off``."""
MAX_FOLDER_BYTES = 10**9
"""Largest size of all files in a folder."""
CACHE_SUFFIX = ".cached"
_FIRST_LINE = b"tactograph kept 1\n"


def cache_folder() -> Path | None:
    """The folder of the cache; None if it is off."""
    setting = os.environ.get(FOLDER_VARIABLE, "")
    if setting == "off":
        return None
    return Path(setting or platformdirs.user_cache_dir("tactograph", appauthor=False))


@cache
def can_be_written(folder: Path) -> bool:
    """Return whether a folder is there, or can be made, and can be written to."""
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    return os.access(folder, os.W_OK)


def cached_file(folder: str, *origin: Any) -> Path | None:
    """The file, in this folder of the cache, for what `origin` makes; None if the cache is off."""
    whole = cache_folder()
    key = hashlib.blake2b(repr(origin).encode(), digest_size=16).hexdigest()
    return None if whole is None else whole / folder / f"{key}{CACHE_SUFFIX}"


def read_cached(file: Path) -> bytes | None:
    """The content of a file; None if it is absent, damaged or another user's."""
    try:
        if hasattr(os, "getuid") and file.stat().st_uid != os.getuid():
            return None
        with file.open("rb") as stream:
            if stream.readline() != _FIRST_LINE:
                return None
            check, body = stream.readline().strip(), stream.read()
        if f"{zlib.crc32(body):08x}".encode() != check:
            return None
        os.utime(file)
    except OSError:
        return None
    return body


def write_cached(file: Path, body: bytes, most_bytes: int = MAX_FOLDER_BYTES) -> None:
    """Write a file; ignore a full or read-only disk."""
    if len(body) > most_bytes // 4:
        return
    with suppress(OSError, InputError):
        file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        check = f"{zlib.crc32(body):08x}"
        with atomic_file(file) as stage:
            stage.write_bytes(_FIRST_LINE + check.encode() + b"\n" + body)
        _make_room(file, most_bytes)


def _make_room(new: Path, most: int) -> None:
    """Delete the least recently read files."""
    stats = []
    for file in os.scandir(new.parent):
        with suppress(OSError):
            if file.name.endswith(CACHE_SUFFIX):
                stats.append((file.stat().st_mtime, file.stat().st_size, file.path))
    total = 0
    for _, size, path in sorted(stats, reverse=True):
        total += size
        if total > most and path != str(new):
            Path(path).unlink(missing_ok=True)
