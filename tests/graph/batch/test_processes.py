"""As many processes are started as make up for it."""

from __future__ import annotations

from typing import Any

import pytest

from tactograph.graph.backends.devices import Device
from tactograph.graph.batch import processes
from tactograph.graph.batch.job import Job
from tactograph.graph.batch.processes import worth_starting


@pytest.mark.parametrize(
    ("captures", "kind", "number"),
    [(0, "CPU", 1), (300, "CPU", 1), (800, "CPU", 3), (9000, "CPU", 4), (9000, "GPU", 1)],
)
def test_a_process_has_a_core_and_captures_enough(
    monkeypatch: pytest.MonkeyPatch, captures: int, kind: str, number: int
) -> None:
    handle: Any = None
    device = Device("a device", kind, handle, works=True, verdict="", simulator=False)
    monkeypatch.setattr(processes, "choose_device", lambda _: (device, ""))
    monkeypatch.setattr(processes, "cores", lambda: 4)
    assert worth_starting(job(computes_on="a device"), captures) == number


def test_without_a_device_the_cores_are_shared_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "cores", lambda: 4)
    assert worth_starting(job(), 9000) == 4


def job(computes_on: str = "") -> Job:
    return Job("", "", "", {}, {}, "capture", (), 16, computes_on=computes_on)
