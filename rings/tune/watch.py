"""A graph's files, and a stamp that tells whether one has changed."""

from collections.abc import Collection
from contextlib import suppress
from pathlib import Path

from tactograph.sdk import Graph

Stamp = tuple[tuple[str, int, int], ...]


def files_of(graph: Graph) -> set[Path]:
    """The files of a graph, and the files and folders that its params default to."""
    places = [*graph.places.values()]
    places += [place for entry in graph.nodes.values() for place in entry.places.values()]
    read = {Path(place.file) for place in places if place.line}
    return read | {
        Path(param.default)
        for name, param in graph.params.items()
        if param.kind == "path" and name != "out" and isinstance(param.default, str | Path)
    }


def stamp(files: Collection[Path]) -> Stamp:
    """A value that changes when one of the files does, or a file in one of the folders."""
    stamps: list[tuple[str, int, int]] = []
    for path in sorted(files):
        with suppress(OSError):
            inside = sorted(path.rglob("*")) if path.is_dir() else [path]
            for file in inside:
                with suppress(OSError):
                    stat = file.stat()
                    stamps.append((str(file), stat.st_mtime_ns, stat.st_size))
    return tuple(stamps)
