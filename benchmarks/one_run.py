"""What the scripts share: a run of a graph on one capture, and a row of a Markdown table."""

from collections.abc import Mapping
from typing import Any

from tactograph.graph.files.changes import with_changes
from tactograph.graph.files.read_graph import Source, read_graph
from tactograph.graph.run.open_pipeline import open_pipeline


def run(graph: Source, changes: Mapping[str, Any] | None = None, **params: Any) -> Any:
    """Run a graph on one capture; its files are written if `out` is given."""
    changed = with_changes(read_graph(graph), changes or {})
    (result,) = open_pipeline(changed, params, sinks="out" in params).items()
    return result


def row(*cells: str) -> None:
    print("|", " | ".join(cells), "|", flush=True)
