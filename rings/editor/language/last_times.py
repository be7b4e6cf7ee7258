"""The times of a graph's last run, beside its nodes."""

import json
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from tactograph.sdk import RESULT_FILE
from tactograph.sdk.unstable import Document, Graph

FOLDER_DEPTHS = ("", "*/", "*/*/")
"""How far below a folder results are looked for."""


def times_beside(text: str, graph: Graph, folders: list[Path]) -> Iterator[tuple[int, str]]:
    """Lines, from 0, of nodes and changes, each with the milliseconds of what it speaks of."""
    times = _last_times(graph.name, folders)
    document = Document.parse(text, "")
    for line, name in _named(document) if times else ():
        full = graph.in_full(name)
        spent = [ms for node, ms in times.items() if f"{node}.".startswith(f"{full}.")]
        if spent:
            yield line, f"{sum(spent):.2g} ms" if sum(spent) < 100 else f"{sum(spent):.0f} ms"


def _named(document: Document) -> Iterator[tuple[int, str]]:
    """The lines that name a node of the graph."""
    for path, place in document.places.items():
        match path:
            case ("nodes", str(name)):
                yield place.line - 1, name
            case ("patch", int(at), "set" | "replace" | "insert" | "backend" as verb):
                yield place.line - 1, str(document.data["patch"][at][verb])


def _last_times(name: str, folders: list[Path]) -> dict[str, float]:
    """Milliseconds of each node, from the newest result of a graph of this name."""
    files = {
        file for f in folders for depth in FOLDER_DEPTHS for file in f.glob(f"{depth}{RESULT_FILE}")
    }
    for file in sorted(files, key=lambda each: each.stat().st_mtime, reverse=True):
        with suppress(OSError, ValueError, KeyError, TypeError):
            timings = json.loads(file.read_text(encoding="utf-8"))
            if timings["graph"]["name"] == name:
                return {node["node"]: float(node["ms"]) for node in timings["nodes"]}
    return {}
