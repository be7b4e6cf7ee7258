"""A job's pipeline is opened once for all captures, and may be opened ahead of them."""

import pytest

from tactograph.graph.batch.job import Job, make_job
from tactograph.graph.batch.open_job import forget_pipeline, graph_of, open_ahead, pipeline_of
from tactograph.graph.errors import InputError
from tactograph.graph.files.read_graph import read_graph
from tests.graph.batch.test_batch import LIT
from tests.graph.conftest import Write


@pytest.fixture
def job(write: Write) -> Job:
    return make_job(read_graph(write(LIT)), {}, out="out.zarr")


def test_what_was_opened_ahead_is_what_is_used(job: Job) -> None:
    open_ahead(job, graph_of(job))
    opened = pipeline_of(job)
    open_ahead(job, graph_of(job))
    assert pipeline_of(job) is opened


def test_a_pipeline_that_was_forgotten_is_opened_again(job: Job) -> None:
    opened = pipeline_of(job)
    forget_pipeline()
    assert pipeline_of(job) is not opened


def test_another_job_has_another_pipeline(job: Job, write: Write) -> None:
    other = make_job(read_graph(write(LIT)), {"level": 0.25}, out="out.zarr")
    assert pipeline_of(job) is not (opened := pipeline_of(other))
    assert opened is pipeline_of(other)


def test_what_cannot_be_opened_ahead_is_told_to_whoever_needs_it(write: Write) -> None:
    job = make_job(read_graph(write(LIT)), {}, out="out.zarr", device="no such device")
    open_ahead(job, graph_of(job))
    for _ in range(2):
        with pytest.raises(InputError, match="no such device"):
            pipeline_of(job)
