"""A batch starts as many processes as are worth their start."""

from types import SimpleNamespace

import pytest

from rings.batch.tests.stores import TAKING
from tactograph.graph.commands import RunOptions
from tactograph.rings.batch import fork_server as module
from tactograph.rings.batch.fork_server import at_most, worker_count
from tests.graph.conftest import graph_of

GRAPH, OPTIONS = graph_of(TAKING), RunOptions((), (), None, None, strict=False)


@pytest.mark.parametrize(
    ("captures", "is_cpu", "number"),
    [(0, True, 1), (300, True, 1), (800, True, 3), (9000, True, 4), (9000, False, 1)],
)
def test_a_process_has_a_core_and_captures_enough(
    monkeypatch: pytest.MonkeyPatch, captures: int, is_cpu: bool, number: int
) -> None:
    device = SimpleNamespace(is_cpu=is_cpu)
    monkeypatch.setattr(RunOptions, "open_device", lambda *_: (device, ""))
    monkeypatch.setattr(module, "cores", lambda: 4)
    assert worker_count(GRAPH, OPTIONS, captures) == number
    assert at_most(captures) >= number


def test_without_a_device_the_cores_are_shared_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "cores", lambda: 4)
    assert worker_count(GRAPH, RunOptions((), (), "numpy", None, strict=False), 9000) == 4
