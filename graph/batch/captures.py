"""Find the captures of a batch: local folders or object-store URLs, by pattern."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import fsspec

from tactograph.graph.errors import InputError
from tactograph.graph.files.content_hash import content_hash


def is_url(place: str) -> bool:
    return "://" in place


def absolute(place: str) -> str:
    """A place that means the same to a worker elsewhere."""
    return place if is_url(place) else str(Path(place).absolute())


def find_captures(patterns: Sequence[str]) -> list[str]:
    """Return every place that a pattern matches, once, in order of name.

    Parameters
    ----------
    patterns
        Paths or URLs with ``*``, ``?``, ``[...]`` and ``**`` as a shell takes them.

    Raises
    ------
    InputError
        If a pattern matches nothing, or its file system is not known.
    """
    found: dict[str, None] = {}
    for pattern in patterns:
        if not pattern.strip():
            raise InputError("--over is empty; give a pattern such as 'recordings/*'")
        matches = _matches(pattern)
        if not matches:
            raise InputError(f"--over {pattern}: nothing is there")
        found.update(dict.fromkeys(matches))
    return list(found)


def _matches(pattern: str) -> list[str]:
    try:
        system, path = fsspec.core.url_to_fs(absolute(pattern))
        matches = system.glob(path.rstrip("/"))
    except (ValueError, ImportError, OSError) as error:
        raise InputError(f"--over {pattern}: {error}") from None
    if not path.rstrip("/").rpartition("/")[2].startswith("."):
        # What a killed writer left is no capture.
        matches = [m for m in matches if not str(m).rpartition("/")[2].startswith(".")]
    return sorted(system.unstrip_protocol(m) if is_url(pattern) else str(m) for m in matches)


def content_of(place: str) -> str:
    """What tells one content of a file or folder from another: a hash, or what the store says.

    Raises
    ------
    InputError
        If nothing is there.
    """
    if not is_url(place):
        return content_hash(Path(place))
    try:
        system, path = fsspec.core.url_to_fs(place)
        return str(system.checksum(path))
    except (ValueError, ImportError, OSError) as error:
        raise InputError(f"{place}: {error}") from None


def kept_at_hand(place: str) -> str:
    """A local path of a file for as long as this process runs.

    Raises
    ------
    InputError
        If it cannot be fetched.
    """
    if not is_url(place):
        return place
    try:
        return str(fsspec.open_local(f"simplecache::{place}"))
    except (ValueError, ImportError, OSError) as error:
        raise InputError(f"{place}: {error}") from None


@contextmanager
def at_hand(place: str) -> Iterator[str]:
    """Yield a local path of `place`; what lies elsewhere is fetched, and gone afterwards.

    Raises
    ------
    InputError
        If it cannot be fetched.
    """
    if not is_url(place):
        yield place
        return
    with tempfile.TemporaryDirectory(prefix="tactograph-") as folder:
        target = Path(folder) / place.rstrip("/").rpartition("/")[2]
        try:
            system, path = fsspec.core.url_to_fs(place)
            system.get(path, str(target), recursive=True)
        except (ValueError, ImportError, OSError) as error:
            raise InputError(f"{place}: {error}") from None
        yield str(target)
