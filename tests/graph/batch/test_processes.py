"""As many processes are started as make up for it."""

from __future__ import annotations

import os
import signal
from types import SimpleNamespace

import pytest

from tactograph.graph.batch import processes
from tactograph.graph.batch.processes import Processes, worth_starting
from tactograph.graph.errors import InputError


@pytest.mark.parametrize(
    ("captures", "is_cpu", "number"),
    [(0, True, 1), (300, True, 1), (800, True, 3), (9000, True, 4), (9000, False, 1)],
)
def test_a_process_has_a_core_and_captures_enough(
    monkeypatch: pytest.MonkeyPatch, captures: int, is_cpu: bool, number: int
) -> None:
    device = SimpleNamespace(is_cpu=is_cpu)
    monkeypatch.setattr(processes, "open_device", lambda *_: (device, ""))
    monkeypatch.setattr(processes, "cores", lambda: 4)
    assert worth_starting(["opencl", "numpy"], None, captures) == number


def test_without_a_device_the_cores_are_shared_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "cores", lambda: 4)
    assert worth_starting(["numpy"], None, 9000) == 4


def answer(question: str) -> str:
    """Answer a question, or die of it."""
    if question == "deadly":
        os.kill(os.getpid(), signal.SIGKILL)
    if question == "foolish":
        raise InputError("cannot be answered")
    return f"{question}!"


def test_processes_answer_also_after_one_has_died_of_a_question() -> None:
    with Processes(2) as workers:
        assert workers.ask(answer, "easy") == "easy!"
        with pytest.raises(InputError, match="deadly: its process died; run this capture alone"):
            workers.ask(answer, "deadly")
        with pytest.raises(InputError, match="cannot be answered"):
            workers.ask(answer, "foolish")
        assert workers.ask(answer, "easy again") == "easy again!"
