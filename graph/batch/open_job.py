"""The pipeline of a job, opened once for all captures."""

import threading
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from tactograph.graph.batch.job import Job
from tactograph.graph.disk.strict_yaml import parse_yaml
from tactograph.graph.errors import TactographError
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.files.read_graph import graphs_of
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
    name = f"{job.name}.yaml"
    return replace(graphs_of(parse_yaml(job.graph, name), Path(name))[0], places={})


def forget_pipeline() -> None:
    """Open the pipeline again when it is next needed."""
    _mine.job = None


def _open(job: Job, graph: Graph) -> Pipeline:
    return open_pipeline(
        graph,
        job.given,
        backend=job.backend,
        device=job.device,
        strict=job.strict,
        sinks=job.folders is not None,
    )
