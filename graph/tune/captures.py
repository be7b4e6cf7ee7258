"""The captures that a graph is tuned on, or none if its stream has its own items."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tactograph.graph.files.captures_in import captures_in
from tactograph.graph.files.flat_graph import Graph

CAPTURE_PARAM = "capture"
"""The param that names a capture, as in `compare`."""


def captures_of(graph: Graph, given: Mapping[str, Any]) -> list[Path]:
    """The captures that a user can step through; empty where the stream goes one way."""
    if CAPTURE_PARAM not in graph.params or not isinstance(given.get(CAPTURE_PARAM), str):
        return []
    folder = Path(given[CAPTURE_PARAM])
    return captures_in(folder) if folder.is_dir() else []
