"""Workers of a Dask cluster.  Dask schedules; this module bounds the chunks that are out."""

import asyncio
import json
import logging
import platform
import re
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from tactograph.graph.batch.open_job import graph_of
from tactograph.graph.batch.worker import Answer, Chunk, Tally, do_chunk, fail_chunk, store_of
from tactograph.graph.cache.result_origin import find_origin
from tactograph.graph.errors import InputError, message_of
from tactograph.graph.extras import need

MAX_WORKER_DEATHS = 3
"""Times that Dask may give up a chunk because its workers died."""
ANSWER_TIMEOUT_S = 30.0
"""Time for a scheduler to answer."""
RECONNECT_TIMEOUT_S = 300.0
"""Time to wait for a scheduler that has gone."""
CHUNKS_PER_THREAD = 3
"""Chunks out per worker thread: one that runs, the others on their way."""


class Cluster:
    """A Dask scheduler at an address, ``tcp://host:port``, or in the file that it wrote.

    `tell` is called with a line whenever the scheduler has gone.  Raises InputError if
    dask.distributed is not installed, the file is none of a scheduler, or no scheduler answers.
    """

    def __init__(self, scheduler: str, tell: Callable[[str], None] = print) -> None:
        self._tell = tell
        self._scheduler = scheduler
        self.name = f"Dask at {scheduler}"
        self._client = self._connect()

    def ask(self, question: Callable[..., Answer], *about: Any) -> Answer:
        """Answer a question in this process, which has the same code and files as the workers."""
        return question(*about)

    def run(self, chunks: Iterable[Chunk]) -> Iterator[Tally]:
        """Do every chunk, and yield the tally of each.

        Chunks whose workers or scheduler have gone are handed out again; results already written
        count.  Neither the scheduler nor this process holds more chunks than those under way.
        """
        from distributed import KilledWorker

        waiting, deaths = deque(chunks), Counter[Chunk]()
        running: dict[Any, Chunk] = {}
        while waiting or running:
            try:
                self._hand_out(waiting, running)
                ended = self._ended(running)
            except (OSError, TimeoutError, CancelledError) as error:
                waiting.extendleft(running.values())
                running = {}
                self._reconnect(error)
                continue
            for future, outcome in ended:
                chunk = running.pop(future)
                if isinstance(outcome, Tally):
                    yield outcome
                elif not isinstance(outcome, KilledWorker):
                    raise outcome
                elif deaths[chunk] < MAX_WORKER_DEATHS:
                    deaths[chunk] += 1
                    waiting.appendleft(chunk)
                else:
                    yield fail_chunk(chunk, f"its workers died: {outcome}")

    def close(self) -> None:
        self._client.close()

    def _hand_out(self, waiting: deque[Chunk], running: dict[Any, Chunk]) -> None:
        """Hand out as many chunks as keep every worker busy; workers come and go."""
        threads = sum(self._client.nthreads().values())
        room = max(CHUNKS_PER_THREAD * threads, 2 * CHUNKS_PER_THREAD)
        for _ in range(min(room - len(running), len(waiting))):
            running[self._client.submit(do_chunk_elsewhere, waiting[0], pure=False)] = waiting[0]
            waiting.popleft()

    def _ended(self, running: dict[Any, Chunk]) -> list[tuple[Any, Tally | Exception]]:
        """Futures that ended, with their tallies or errors.

        Raises ConnectionError or CancelledError if the scheduler has gone, or has forgotten them.
        """
        from distributed import wait

        with self._client.as_current(), suppress(TimeoutError):
            wait(list(running), timeout=2.0, return_when="FIRST_COMPLETED")
        if self._client.status != "running":
            raise ConnectionError("the scheduler has gone")
        ended: list[tuple[Any, Tally | Exception]] = []
        for future in running:
            if future.status in ("cancelled", "lost"):
                raise ConnectionError("the scheduler has forgotten chunks")
            if future.status == "error":
                ended.append((future, future.exception()))
            elif future.status == "finished":
                ended.append((future, future.result()))
        return ended

    def _reconnect(self, reason: Exception) -> None:
        self._tell(f"{self.name}: {reason}; waiting for it")
        self._client.close(timeout=2)
        until = time.monotonic() + RECONNECT_TIMEOUT_S
        while True:
            try:
                self._client = self._connect()
                return
            except InputError:
                if time.monotonic() > until:
                    raise
                time.sleep(1.0)

    def _connect(self) -> Any:
        is_address = re.search(r":\d+$", self._scheduler) is not None
        address = self._scheduler if is_address else _address_in(self._scheduler)
        need("dask", "a cluster", "distributed")
        from distributed import Client

        # One line reports an error, no traceback; importing sets a level of its own.
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        try:
            asyncio.run(_greet(address))
            return Client(address, timeout=ANSWER_TIMEOUT_S, set_as_default=False)
        except Exception as error:  # another program at that address may answer anything
            reason = message_of(error) or f"nothing came within {ANSWER_TIMEOUT_S:.0f} s"
            raise InputError(
                f"{self.name}: no scheduler answers: {reason}; is it running there?"
            ) from None


async def _greet(address: str) -> None:
    """Wait for a scheduler's answer; a client would wait forever for another program."""
    from distributed.core import rpc
    from distributed.security import Security

    security = Security().get_connection_args("client")
    async with (
        asyncio.timeout(ANSWER_TIMEOUT_S),
        rpc(address, connection_args=security) as scheduler,
    ):
        await scheduler.identity()


def do_chunk_elsewhere(chunk: Chunk) -> Tally:
    """Do a chunk on a machine whose code may differ from that of the batch.

    Raises InputError if that is so.
    """
    _check_origin(chunk.out, chunk.stamp)
    return do_chunk(chunk)


@cache
def _check_origin(out: str, stamp: str) -> None:
    """Refuse to add results of other code or other versions to a store."""
    store = store_of(out, stamp)
    job, begun = store.job, store.origin
    here = find_origin(graph_of(job), backend=job.backend, device=job.device)
    for kind, then, now in (
        ("code of", begun.code, here.code),
        ("version of", begun.versions, here.versions),
    ):
        others = sorted(n for n in {*then, *now} if then.get(n) != now.get(n))
        if others:
            raise InputError(
                f"this worker ({platform.node()}) has another {kind} {', '.join(others)} than "
                "the batch was started with; install the same, or give another --out"
            )


def _address_in(file: str) -> str:
    """Read the address in a scheduler's file, which Dask itself would wait for or fail on."""
    try:
        about = json.loads(Path(file).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"--scheduler {file}: there is no such file") from None
    except (OSError, ValueError) as error:
        raise InputError(f"--scheduler {file}: cannot be read: {error}") from None
    if not isinstance(about, dict) or not isinstance(about.get("address"), str):
        raise InputError(
            f"--scheduler {file}: holds no address; 'dask scheduler --scheduler-file' writes one"
        )
    address: str = about["address"]
    return address
