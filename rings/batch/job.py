"""The work on every capture of a batch."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tactograph.rings.batch.captures import absolute
from tactograph.sdk import Graph, InputError, Pipeline, RunOptions


@dataclass(frozen=True)
class Job:
    """The work on a capture, and the `place` of the store.

    `maps` are the outputs that the store keeps; None: all that are an H x W map.  `folders` is the
    folder for result folders, which mirror the layout of the folder `below`; None if maps go into
    the store.
    """

    graph: Graph
    arguments: dict[str, Any]
    options: RunOptions
    place: str
    maps: tuple[str, ...] | None = None
    folders: str | None = None
    below: str = ""

    def open(self) -> Pipeline:
        """Open the pipeline.  Raises TactographError if it cannot be opened here."""
        arguments = {**self.arguments, **self.graph.at_capture(".")}
        return self.options.open(self.graph, arguments, sinks=self.folders is not None)

    def identity(self, origin: Mapping[str, Any]) -> dict[str, Any]:
        """All that decides a capture's results, and must not change between parts of a store."""
        maps = None if self.maps is None else [*self.maps]
        return {**origin, "maps": maps, "folders": self.folders}


def make_job(
    graph: Graph,
    arguments: Mapping[str, Any],
    options: RunOptions,
    *,
    out: str,
    maps: Sequence[str] | None = None,
    below: str = "",
) -> Job:
    """Make the job for every capture; see `Job`.

    If the name of `out` does not end in ``.zarr``, it is a folder for the files of the graph's own
    sinks, by capture, and the store in it holds the rest.  Raises InputError if the graph takes no
    capture, or `out` cannot be.
    """
    if graph.capture_param is None or graph.params[graph.capture_param].kind != "path":
        raise InputError(
            f"{graph.name} has no parameter 'capture' for the folder of a capture"
            f" (it has: {', '.join(graph.params)})"
        )
    for name, option in ((graph.capture_param, "--over"), ("out", "--out")):
        if name in arguments:
            raise InputError(
                f"{name}={arguments[name]}: in a batch {option} says that; leave it out"
            )
    paths = {name for name, param in graph.params.items() if param.kind == "path"}
    arguments = {
        n: absolute(v) if n in paths and v is not None else v for n, v in arguments.items()
    }
    if not out.strip():
        raise InputError("--out is empty; give NAME.zarr, or a folder")
    place = absolute(out)
    if place.endswith(".zarr"):
        return Job(graph, arguments, options, place, None if maps is None else tuple(maps))
    if maps is not None:
        raise InputError(
            f"--maps {','.join(maps)}: what a store keeps (--out NAME.zarr); a folder of results "
            "has all layers: leave it out"
        )
    if "out" not in graph.params:
        raise InputError(
            f"--out {out}: folders are written by the graph's sinks, through its parameter 'out'; "
            "else give a store, NAME.zarr"
        )
    return Job(graph, arguments, options, f"{place}/batch.zarr", (), place, below)
