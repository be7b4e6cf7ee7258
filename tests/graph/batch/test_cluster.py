"""A batch on a Dask cluster: workers may die, the scheduler may go, the client may come back."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.graph.batch import cluster
from tactograph.graph.batch.batch import open_chunks, run_batch
from tactograph.graph.batch.cluster import Cluster, do_chunk_elsewhere
from tactograph.graph.batch.entry import DONE
from tactograph.graph.batch.store import Store
from tactograph.graph.batch.worker import Chunk
from tests.graph.batch.test_batch import LIT, begin, expected, lit, make_capture
from tests.graph.conftest import Write

pytestmark = pytest.mark.slow
START = "from distributed.cli.dask_{0} import main; main()"


class Machines:
    """A scheduler and two workers, each a process of its own."""

    def __init__(self) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        self.port = self.address.rpartition(":")[2]
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", self.port)
        self.workers = [self.start_worker() for _ in range(2)]

    def start_worker(self) -> subprocess.Popen[bytes]:
        return self._start(
            "worker", self.address, "--host", "127.0.0.1", "--nthreads", "1", "--no-nanny"
        )

    def restart_scheduler(self) -> None:
        self.scheduler.kill()
        self.scheduler.wait()
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", self.port)

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()

    def _start(self, what: str, *words: str) -> subprocess.Popen[bytes]:
        extra = ["--no-dashboard"] if what == "scheduler" else []
        return subprocess.Popen(
            [sys.executable, "-c", START.format(what), *words, *extra],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd=Path(__file__).parents[3],
        )


@pytest.fixture
def machines() -> Iterator[Machines]:
    made = Machines()
    yield made
    made.close()


@pytest.fixture
def captures(tmp_path: Path) -> list[Path]:
    return [make_capture(tmp_path / "many" / f"{n:03}", n) for n in range(40)]


def open_chunks_of(graph: str, tmp_path: Path) -> tuple[Store, list[Chunk]]:
    out = str(tmp_path / "out.zarr")
    store = begin(graph, str(tmp_path / "many" / "*"), out, chunk=2)
    return store, open_chunks(out, store, retry_failed=False)


def assert_whole(store: Store, captures: list[Path]) -> None:
    assert list(store.statuses) == [DONE] * len(captures)
    for number, capture in enumerate(captures):
        np.testing.assert_array_equal(lit(store, number), expected(capture))


def test_a_batch_outlives_its_workers_and_its_scheduler(
    write: Write, tmp_path: Path, captures: list[Path], machines: Machines
) -> None:
    store, chunks = open_chunks_of(write(LIT, "lit.yaml"), tmp_path)
    cluster = Cluster(machines.address)
    tallies = run_batch(store, chunks, cluster)
    next(tallies)
    os.kill(machines.workers[0].pid, signal.SIGKILL)
    machines.workers.append(machines.start_worker())
    next(tallies)
    machines.restart_scheduler()
    machines.workers.append(machines.start_worker())
    list(tallies)
    cluster.close()
    assert_whole(store, captures)


def test_a_client_that_comes_back_goes_on_where_it_was(
    write: Write, tmp_path: Path, captures: list[Path], machines: Machines
) -> None:
    store, chunks = open_chunks_of(write(LIT, "lit.yaml"), tmp_path)
    cluster = Cluster(machines.address)
    next(run_batch(store, chunks, cluster))
    cluster.close()
    time.sleep(0.2)
    store, left = open_chunks_of(write(LIT, "lit.yaml"), tmp_path)
    assert len(left) < len(chunks), "nothing was done; the test says nothing"
    list(run_batch(store, left, Cluster(machines.address)))
    assert_whole(store, captures)


def test_a_scheduler_that_is_not_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "ANSWER_TIMEOUT_S", 0.5)
    with pytest.raises(InputError, match="no scheduler answers"):
        Cluster("tcp://127.0.0.1:9")


@pytest.mark.parametrize("says", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n" * 9, bytes(99)])
def test_another_program_is_no_scheduler(monkeypatch: pytest.MonkeyPatch, says: bytes) -> None:
    def answer(server: socket.socket) -> None:
        caller, _ = server.accept()
        callers.append(caller)
        caller.sendall(says)

    monkeypatch.setattr(cluster, "ANSWER_TIMEOUT_S", 1.0)
    callers: list[socket.socket] = []
    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=answer, args=(server,), daemon=True).start()
        with pytest.raises(InputError, match=r"no scheduler answers: .*; is it running there\?"):
            Cluster(f"tcp://127.0.0.1:{server.getsockname()[1]}")
    for caller in callers:
        caller.close()


def test_a_worker_with_other_code_is_refused(
    write: Write, tmp_path: Path, captures: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    store, chunks = open_chunks_of(write(LIT, "lit.yaml"), tmp_path)
    other = replace(store.origin, code={**store.origin.code, "tactograph.nodes": "other"})
    monkeypatch.setattr(cluster, "find_origin", lambda *_, **__: other)
    for _ in range(2):
        with pytest.raises(InputError, match=r"another code of tactograph\.nodes than the batch"):
            do_chunk_elsewhere(chunks[0])
    assert not store.statuses.any()


def test_a_worker_with_the_same_code_does_its_chunk(
    write: Write, tmp_path: Path, captures: list[Path]
) -> None:
    *_, chunks = open_chunks_of(write(LIT, "lit.yaml"), tmp_path)
    assert do_chunk_elsewhere(chunks[0]).done == 2
