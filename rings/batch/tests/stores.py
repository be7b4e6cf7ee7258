"""Stores and jobs without a run."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tactograph.graph.cache.result_origin import find_origin
from tactograph.graph.commands import RunOptions
from tactograph.graph.files.flat_graph import Graph
from tactograph.rings.batch.job import Job, make_job
from tactograph.rings.batch.map_types import MapType
from tactograph.rings.batch.store import Store, create_store
from tests.graph.conftest import graph_of

TAKING = """
format: 1
params: {capture: {kind: path}}
nodes: {frames: {op: read_capture, with: {folder: $capture}}}
outputs: {image: frames.image}
"""


def job_of(
    graph: Graph, arguments: Mapping[str, Any] | None = None, *, out: str = "out.zarr",
    device: str | None = None,
) -> Job:  # fmt: skip
    return make_job(graph, arguments or {}, RunOptions((), (), None, device, strict=False), out=out)


def new_store(place: Path | str, types: Mapping[str, MapType], chunk: int = 4) -> Store:
    """A store for maps of these types, in which nothing is done."""
    job = job_of(graph_of(TAKING), out=str(place))
    return create_store(job, find_origin(job.graph, {}), types, chunk)
