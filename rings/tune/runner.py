"""A graph on its present item, run again after changes, or on the next item."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from tactograph.sdk import Cache, Graph, InputError, Pipeline, Result, load


def captures_of(graph: Graph, params: Mapping[str, Any]) -> list[Path]:
    """The captures that a user can step through; empty where the stream goes one way.

    Raises InputError if there is no such folder.
    """
    folder = params.get(graph.capture_param or "")
    if not isinstance(folder, str):
        return []
    try:
        return [] if Path(folder).is_file() else graph.captures_in(Path(folder))
    except InputError as error:
        raise InputError(f"{graph.capture_param}={error}") from None


class Runner:
    """A pipeline that follows a graph, opened again only if more than settings changed."""

    def __init__(self, params: Mapping[str, Any], backend: str | None, device: str | None) -> None:
        self._params, self._cache = dict(params), Cache()
        self._backend, self._device = backend, device
        self._graph: Graph | None = None
        self.pipeline: Pipeline | None = None
        self._stream: Iterator[Result] | None = None
        self._at: tuple[Path | None, int] = (None, -1)

    def run(
        self, graph: Graph, capture: Path | None, number: int, only: Collection[str] | None = None
    ) -> Result:
        """The result of `graph` on an item: of a capture, or the `number`-th of its stream.

        If the item is the same as before, only the outputs `only` are made.

        Raises TactographError if the graph cannot be opened, or a node fails.
        """
        if self._graph is None or not _alike(self._graph, graph):
            self._open(graph, capture)
        pipeline, before = self.pipeline, self._graph
        assert pipeline is not None
        assert before is not None
        for name, entry in graph.nodes.items():
            old = before.nodes[name].settings
            changed = {key: v for key, v in entry.settings.items() if old.get(key, old) != v}
            if changed:
                pipeline.set(name, **changed)
        self._graph = graph
        if self._at == (capture, number) and self._stream is not None:
            return pipeline.again(only)
        if capture is not None and self._at[0] != capture:
            self._end()
            pipeline.aim(**graph.at_capture(capture))
        if self._stream is None:
            self._stream = pipeline.items()
        result = next(self._stream, None)
        if result is None:
            self._stream = None
            raise InputError(f"{graph.name}: its stream has ended; there is no next item")
        self._at = capture, number
        return result

    def close(self) -> None:
        """Close the pipeline and its nodes' sessions."""
        self._end()
        if self.pipeline is not None:
            self.pipeline.close()
        self.pipeline, self._graph = None, None

    def _open(self, graph: Graph, capture: Path | None) -> None:
        params = {**self._params, **({} if capture is None else graph.at_capture(capture))}
        params = {name: value for name, value in params.items() if name in graph.params}
        opened = load(graph, params, backend=self._backend, device=self._device, cache=self._cache)
        self.close()
        self.pipeline, self._graph, self._at = opened, graph, (capture, -1)

    def _end(self) -> None:
        if self._stream is not None and hasattr(self._stream, "close"):
            self._stream.close()
        self._stream = None


def _alike(one: Graph, other: Graph) -> bool:
    """Return whether two graphs differ only in settings, all of which the later one states."""

    def bare(graph: Graph) -> Graph:
        nodes = {n: replace(entry, settings={}) for n, entry in graph.nodes.items()}
        return replace(graph, nodes=nodes, title="")

    return bare(one) == bare(other) and all(
        entry.settings.keys() <= other.nodes[name].settings.keys()
        for name, entry in one.nodes.items()
    )
