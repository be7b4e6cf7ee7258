"""A worker opens its pipeline once for all captures, and may open it ahead of them."""

import pytest

from rings.batch.tests.stores import TAKING, job_of
from tactograph.graph.errors import InputError
from tactograph.rings.batch.worker import Worker
from tests.graph.conftest import graph_of


def test_a_pipeline_that_was_opened_ahead_is_the_one_that_works() -> None:
    worker = Worker(job_of(graph_of(TAKING)))
    worker.open_ahead()
    opened = worker._opened
    assert opened is not None
    assert worker._pipeline is opened


def test_a_failure_to_open_ahead_is_raised_where_the_result_is_needed() -> None:
    worker = Worker(job_of(graph_of(TAKING), device="no such device"))
    worker.open_ahead()
    for _ in range(2):
        with pytest.raises(InputError, match="no such device"):
            _ = worker._pipeline
