"""Processes share the cores of the one that starts them."""

import os

import pytest

from tactograph.graph.cores import cores
from tactograph.rings.batch.fork_server import environment, share_of
from tests.fixtures import python

PRINT_CORES = "from tactograph.graph.cores import cores; print(cores())"


def cores_of_a_process() -> int:
    return int(python("-c", PRINT_CORES).stdout)


def test_processes_share_the_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tactograph.graph.cores._bound_to", lambda: 8)
    before = dict(os.environ)
    with environment(share_of(4)):
        assert os.environ["TACTOGRAPH_CORES"] == "2"
        assert os.environ["POCL_MAX_PTHREAD_COUNT"] == "2"
        with environment(share_of(16)):
            assert cores() == 1
    assert dict(os.environ) == before


def test_an_environment_is_taken_over_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TACTOGRAPH_CORES", "3")
    with environment({"PATH": "/nowhere"}):
        assert dict(os.environ) == {"PATH": "/nowhere"}
    assert os.environ["TACTOGRAPH_CORES"] == "3"


def test_a_share_below_one_core_is_one_core(monkeypatch: pytest.MonkeyPatch) -> None:
    with environment(share_of(1000)):
        assert cores_of_a_process() == 1


@pytest.mark.parametrize("name", ["OMP_NUM_THREADS", "POCL_MAX_PTHREAD_COUNT"])
def test_the_users_own_setting_stays(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setenv(name, "7")
    with environment(share_of(2)):
        assert os.environ[name] == "7"
    assert os.environ[name] == "7"
