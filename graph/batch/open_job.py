"""The pipeline of a job, opened once for all captures."""

import tempfile
import threading
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from tactograph.graph.batch.captures import kept_at_hand
from tactograph.graph.batch.job import Job
from tactograph.graph.errors import TactographError
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.files.read_graph import read_graph
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.graph.run.pipeline import Pipeline

_mine = threading.local()
"""The pipeline that this thread keeps, and its job: a pipeline belongs to one thread."""


def pipeline_of(job: Job, graph: Graph | None = None) -> Pipeline:
    """Open a job's pipeline, unless this thread has it open; `graph` is the job's, once read.

    Raises TactographError if it cannot be opened here.
    """
    if getattr(_mine, "job", None) != job:
        forget_pipeline()  # if opening fails, none counts as open
        _mine.pipeline, _mine.job = _open(job, graph or graph_of(job)), job
    pipeline: Pipeline = _mine.pipeline
    return pipeline


def open_ahead(job: Job, graph: Graph) -> None:
    """Open a job's pipeline before it is needed, from a graph that is read already.

    An error is raised again where the pipeline is needed.
    """
    with suppress(TactographError):
        pipeline_of(job, graph)


def graph_of(job: Job) -> Graph:
    """Read the graph of a job, which another process may have made."""
    with tempfile.TemporaryDirectory(prefix="tactograph-") as folder:
        file = Path(folder) / f"{job.name}.yaml"
        file.write_text(job.graph, encoding="utf-8")
        return replace(read_graph(str(file)), places={})


def forget_pipeline() -> None:
    """Open the pipeline again when it is next needed."""
    _mine.job = None


def _open(job: Job, graph: Graph) -> Pipeline:
    paths = {name for name, param in graph.params.items() if param.kind == "path"}
    given = {
        name: kept_at_hand(value) if name in paths and value is not None else value
        for name, value in job.given.items()
    }
    return open_pipeline(
        graph,
        given,
        backend=job.backend,
        device=job.device,
        strict=job.strict,
        sinks=job.folders is not None,
    )
