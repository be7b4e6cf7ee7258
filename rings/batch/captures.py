"""Find the captures of a batch by pattern."""

from collections.abc import Sequence
from glob import glob, has_magic
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

from tactograph.sdk import Graph, InputError


class Captures(NamedTuple):
    """The captures of a batch, the folder in which all patterns begin, and the skipped paths.

    `below` is "" where the patterns have no folder in common.
    """

    captures: list[str]
    below: str
    passed_over: list[str]


def absolute(place: str) -> str:
    """A place in the form that every worker understands."""
    return str(Path(place).absolute())


def find_captures(patterns: Sequence[str]) -> Captures:
    """Find every place that a pattern matches, once, in order of name.

    A pattern is a path with ``*``, ``?``, ``[...]`` and ``**`` as a shell takes them.  A folder
    that holds folders and no file, except YAML, stands for those folders.  Files beside matching
    folders are passed over: a batch never mixes both kinds.  Raises InputError if a pattern matches
    nothing.
    """
    captures: dict[str, None] = {}
    passed_over: dict[str, None] = {}
    spread = [each for pattern in patterns for each in _spread(pattern)]
    for pattern in spread:
        found = sorted(glob(absolute(pattern), recursive=True))  # noqa: PTH207
        if not found:
            raise InputError(f"--over {pattern}: nothing is there")
        matches = [match for match in found if not match.endswith(".yaml")] or found
        folders = [match for match in matches if Path(match).is_dir()]
        captures.update(dict.fromkeys(folders or matches))
        passed_over.update(dict.fromkeys(set(matches) - {*folders} if folders else ()))
    return Captures(list(captures), _common_start(spread), sorted(passed_over))


def _spread(pattern: str) -> list[str]:
    """The pattern itself, or, for a folder of captures, one that matches what it holds."""
    if not pattern.strip():
        raise InputError("--over is empty; give a pattern such as 'recordings/*'")
    folder = Path(pattern)
    if not folder.is_dir() or Graph.captures_in(folder) == [folder]:
        return [pattern]
    return [f"{pattern.rstrip('/')}/*"]


def _common_start(patterns: Sequence[str]) -> str:
    """The folder in which all patterns begin, up to the first ``*``.

    It does not depend on the present files, so that captures can be added later.
    """
    paths = [absolute(pattern).split("/")[:-1] for pattern in patterns]
    common: list[str] = [parts[0] for parts in takewhile(_are_alike, zip(*paths, strict=False))]
    # With ".." the results would not lie below the common folder.
    if len(common) < 2 or any(".." in parts[len(common) :] for parts in paths):
        return ""
    return "/".join(common)


def _are_alike(parts: tuple[str, ...]) -> bool:
    return len({*parts}) == 1 and not has_magic(parts[0])
