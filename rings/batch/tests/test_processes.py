"""Processes answer and work, in the environment of the one that asks."""

import os
import signal
import sys
from concurrent.futures.process import BrokenProcessPool
from types import SimpleNamespace

import pytest

from rings.batch.tests.stores import TAKING, job_of
from tactograph.graph.errors import InputError
from tactograph.graph.run.node_errors import Blaming
from tactograph.rings.batch.processes import Processes
from tests.graph.conftest import graph_of

JOB = job_of(graph_of(TAKING))


def answer(question: str) -> str:
    """Answer a question, or die of it."""
    if question == "deadly":
        os.kill(os.getpid(), signal.SIGKILL)
    if question == "ended":
        task = SimpleNamespace(id="it", node=SimpleNamespace(name="innocent"))
        with Blaming(SimpleNamespace(), task):
            os.kill(os.getpid(), signal.SIGTERM)
    if question == "foolish":
        raise InputError("cannot be answered")
    return f"{question}!"


def test_processes_answer_also_after_one_has_died_of_a_question() -> None:
    with Processes(JOB, 2) as workers:
        assert workers.ask(answer, "easy") == "easy!"
        with pytest.raises(InputError, match="deadly: its process died; run this capture alone"):
            workers.ask(answer, "deadly")
        with pytest.raises(InputError, match="ended: its process died"):
            workers.ask(answer, "ended")
        with pytest.raises(InputError, match="cannot be answered"):
            workers.ask(answer, "foolish")
        assert workers.ask(answer, "easy again") == "easy again!"


def is_imported(module: str) -> bool:
    return module in sys.modules


def test_slow_imports_happen_before_a_process_starts() -> None:
    with Processes(JOB, 2) as workers:
        assert workers.ask(is_imported, "tactograph.rings.batch.imported_ahead")


def test_processes_that_were_started_before_are_those_that_work() -> None:
    pids: set[int] = set()
    with Processes(JOB, 2) as workers:
        workers.open_ahead()
        pids |= {workers.ask(os.getpid) for _ in range(8)}
    assert len(pids) <= 2


def test_a_process_that_dies_before_its_work_ends_no_batch() -> None:
    with Processes(JOB, 2) as workers:
        with pytest.raises(BrokenProcessPool):
            workers._pool.submit(os._exit, 1).result()
        workers.open_ahead()
        with pytest.raises(InputError, match="easy: its process died"):
            workers.ask(answer, "easy")
        assert workers.ask(answer, "easy") == "easy!"


def value_of(name: str) -> str:
    return os.environ.get(name, "")


def test_processes_have_the_environment_of_today(monkeypatch: pytest.MonkeyPatch) -> None:
    """Though a server forks them that may have been started long before."""
    monkeypatch.setenv("TACTOGRAPH_CORES", "2")
    for value in ("early", "late"):
        monkeypatch.setenv("TACTOGRAPH_TEST", value)
        with Processes(JOB, 2) as workers:
            assert workers.ask(value_of, "TACTOGRAPH_TEST") == value
            assert workers.ask(value_of, "TACTOGRAPH_CORES") == "1"
