"""Threads are as many as the cores that a process may use."""

import os

import pytest

from tactograph.graph.cores import cores
from tests.fixtures import python

PRINT_CORES = "from tactograph.graph.cores import cores; print(cores())"


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="processes cannot be bound here")
def test_a_process_bound_to_one_core_starts_one_thread() -> None:
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    try:
        assert cores() == 1
    finally:
        os.sched_setaffinity(0, allowed)
    assert cores() == len(allowed)


def test_a_share_counts_here_and_in_processes_that_are_started(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("TACTOGRAPH_CORES", "8")
    assert cores(at_most=1) == 1
    assert cores() == 1
    assert int(python("-c", PRINT_CORES).stdout) == 1
