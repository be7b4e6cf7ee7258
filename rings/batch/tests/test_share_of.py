"""Processes share the cores of the one that starts them."""

import os

import pytest

from tactograph.rings.batch.fork_server import environment, limited_to, share_of


def test_processes_share_the_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tactograph.graph.cores._bound_to", lambda: 8)
    assert [share_of(workers) for workers in (1, 4, 16)] == [8, 2, 1]
    before = dict(os.environ)
    with environment(limited_to(2)):
        assert os.environ["POCL_MAX_PTHREAD_COUNT"] == "2"
    assert dict(os.environ) == before


def test_an_environment_is_taken_over_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TACTOGRAPH_CORES", "3")
    with environment({"PATH": "/nowhere"}):
        assert dict(os.environ) == {"PATH": "/nowhere"}
    assert os.environ["TACTOGRAPH_CORES"] == "3"


@pytest.mark.parametrize("name", ["OMP_NUM_THREADS", "POCL_MAX_PTHREAD_COUNT"])
def test_the_users_own_setting_stays(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setenv(name, "7")
    with environment(limited_to(2)):
        assert os.environ[name] == "7"
    assert os.environ[name] == "7"
