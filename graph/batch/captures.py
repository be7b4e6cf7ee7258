"""Find the captures of a batch: local folders or object-store URLs, by pattern."""

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

import fsspec
from fsspec.core import has_magic

from tactograph.graph.disk.content_hash import content_hash
from tactograph.graph.disk.text_names import refuse_other_names
from tactograph.graph.errors import InputError, message_of
from tactograph.graph.files.captures_in import captures_in


def is_url(place: str) -> bool:
    return "://" in place


def absolute(place: str) -> str:
    """A place in the form that every worker understands."""
    return place if is_url(place) else str(Path(place).absolute())


class Found(NamedTuple):
    """The captures of a batch, the folder in which all patterns begin, and the skipped paths.

    `below` is "" where the patterns have no folder in common.
    """

    captures: list[str]
    below: str
    passed_over: list[str]


def find_captures(patterns: Sequence[str]) -> Found:
    """Find every place that a pattern matches, once, in order of name.

    A pattern is a path or URL with ``*``, ``?``, ``[...]`` and ``**`` as a shell takes them.  A
    folder that holds folders and no file stands for those folders.  Files beside matching folders
    are passed over: a batch never mixes both kinds.  Raises InputError if a pattern matches
    nothing, its file system is not known, or a name is not UTF-8.
    """
    captures: dict[str, None] = {}
    passed_over: dict[str, None] = {}
    spread = [each for pattern in patterns for each in _spread(pattern)]
    for pattern in spread:
        matches, files = _matches(pattern)
        if not matches:
            raise InputError(f"--over {pattern}: nothing is there")
        captures.update(dict.fromkeys(matches))
        passed_over.update(dict.fromkeys(files))
    for capture in captures:
        refuse_other_names(capture)
    return Found(list(captures), _common_start(spread), list(passed_over))


def _spread(pattern: str) -> list[str]:
    """The pattern itself, or, for a folder of captures, one that matches what it holds."""
    if not pattern.strip():
        raise InputError("--over is empty; give a pattern such as 'recordings/*'")
    folder = Path(pattern)
    if is_url(pattern) or not folder.is_dir() or captures_in(folder) == [folder]:
        return [pattern]
    return [f"{pattern.rstrip('/')}/*"]


def _common_start(patterns: Sequence[str]) -> str:
    """The folder in which all patterns begin, up to the first ``*``.

    It does not depend on the present files, so that captures can be added later.
    """
    paths = [_parts(pattern) for pattern in patterns]
    common: list[str] = [parts[0] for parts in takewhile(_are_alike, zip(*paths, strict=False))]
    # With ".." the results would not lie below the common folder.
    if len(common) < 2 or any(".." in parts[len(common) :] for parts in paths):
        return ""
    return common[0] + "/".join(common[1:])


def _parts(pattern: str) -> list[str]:
    """The scheme and the folders of a pattern, spelled as `_matches` spells its results."""
    system, path = fsspec.core.url_to_fs(absolute(pattern))
    place = str(system.unstrip_protocol(path) if is_url(pattern) else path)
    scheme, mark, path = place.rstrip("/").rpartition("://")
    return [scheme + mark, *path.split("/")[:-1]]


def _are_alike(parts: tuple[str, ...]) -> bool:
    return len({*parts}) == 1 and not has_magic(parts[0])


def _matches(pattern: str) -> tuple[list[str], list[str]]:
    """The captures that a pattern matches, and the files that are none, in order of name."""
    with _reaching(f"--over {pattern}"):
        system, path = fsspec.core.url_to_fs(absolute(pattern))
        matches = system.glob(path.rstrip("/"), detail=True)
    if not path.rstrip("/").rpartition("/")[2].startswith("."):
        # A killed writer's leftover is no capture.
        hidden = {m for m in matches if str(m).rpartition("/")[2].startswith(".")}
        matches = {m: about for m, about in matches.items() if m not in hidden}
    files = {m for m, about in matches.items() if about["type"] == "file"}
    if len(files) == len(matches):
        files = set()
    named = {m: system.unstrip_protocol(m) if is_url(pattern) else str(m) for m in matches}
    return sorted(named[m] for m in named if m not in files), sorted(named[m] for m in files)


@contextmanager
def _reaching(place: str) -> Iterator[None]:
    """Say in one line why a place cannot be reached: file systems raise errors of their own."""
    try:
        yield
    except MemoryError:
        raise
    except Exception as error:
        raise InputError(f"{place}: {message_of(error) or type(error).__name__}") from None


def content_of(place: str) -> str:
    """A hash of the content of a file or folder, or the object store's checksum.

    Raises InputError if nothing is there.
    """
    if not is_url(place):
        return content_hash(Path(place))
    with _reaching(place):
        system, path = fsspec.core.url_to_fs(place)
        return str(system.checksum(path))


def kept_at_hand(place: str) -> str:
    """A local path of a file, valid as long as this process runs.

    Raises InputError if it cannot be fetched.
    """
    if not is_url(place):
        return place
    with _reaching(place):
        return str(fsspec.open_local(f"simplecache::{place}"))


@contextmanager
def at_hand(place: str) -> Iterator[str]:
    """Yield a local path of `place`; a remote place is fetched, and the copy removed afterwards.

    Raises InputError if it cannot be fetched.
    """
    if not is_url(place):
        yield place
        return
    with tempfile.TemporaryDirectory(prefix="tactograph-") as folder:
        target = Path(folder) / place.rstrip("/").rpartition("/")[2]
        with _reaching(place):
            system, path = fsspec.core.url_to_fs(place)
            system.get(path, str(target), recursive=True)
        yield str(target)
