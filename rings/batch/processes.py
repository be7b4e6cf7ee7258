"""Workers on this machine: a pool of processes that survives the death of any of them."""

from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import partial
from itertools import islice
from typing import Any, Self, TypeVar

from tactograph.rings.batch.entry import FAILED, Entry
from tactograph.rings.batch.fork_server import hand_over, start_processes, stop_processes
from tactograph.rings.batch.job import Job
from tactograph.rings.batch.map_types import MapType
from tactograph.rings.batch.store import open_store
from tactograph.rings.batch.worker import Chunk, Tally, Worker
from tactograph.sdk import InputError

Answer = TypeVar("Answer")
PROCESS_DEATHS = (BrokenProcessPool, SystemExit)
"""Errors of a chunk whose process was killed or ended by itself."""
RUN_ALONE_HINT = "run this capture alone to see why"


_worker: Worker
"""The worker of this process, if that belongs to a pool."""


def set_up(job: Job) -> None:
    """Make the worker of this process."""
    global _worker
    _worker = Worker(job)


def open_ahead() -> None:
    """Open the pipeline of this process."""
    _worker.open_ahead()


def find_map_types(place: str) -> dict[str, MapType]:
    """The types of the maps, from a capture."""
    return _worker.map_types(place)


def do_chunk(chunk: Chunk) -> Tally:
    """Do a chunk in this process."""
    (tally,) = _worker.run([chunk])
    return tally


class Processes:
    """A pool of `number` processes, each with a worker; `do` does a chunk there.

    They start with their first work, and end with the ``with`` block.
    """

    def __init__(self, job: Job, number: int, do: Callable[[Chunk], Tally] = do_chunk) -> None:
        self._job, self._number, self._do = job, number, do
        self._idle: ProcessPoolExecutor | None = None
        self.name = f"{number} processes"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            stop_processes()
        if self._idle is not None:
            self._idle.shutdown(cancel_futures=True)

    def open_ahead(self) -> None:
        """Start to open the graph in all processes.  One that dies of it is told at work."""
        with suppress(BrokenProcessPool):
            for _ in range(self._number):
                hand_over(self._pool, open_ahead)

    def map_types(self, place: str) -> dict[str, MapType]:
        """The types of the maps, from a capture.  Raises TactographError if it cannot be done."""
        return self.ask(find_map_types, place)

    def ask(self, question: Callable[..., Answer], *about: Any) -> Answer:
        """Ask one of the processes.  Raises InputError if it dies."""
        try:
            return hand_over(self._pool, question, *about).result()
        except PROCESS_DEATHS:
            self._idle = None
            raise InputError(f"{about[-1]}: its process died; {RUN_ALONE_HINT}") from None

    @property
    def _pool(self) -> ProcessPoolExecutor:
        self._idle = self._idle or self._start(self._number)
        return self._idle

    def _start(self, number: int) -> ProcessPoolExecutor:
        return start_processes(number, partial(set_up, self._job))

    def run(self, chunks: Iterable[Chunk]) -> Iterator[Tally]:
        """Do every chunk, and yield the tally of each.

        When a process dies, every chunk that was under way is done again, alone.  A chunk that
        kills its process is so found and recorded as failed; the rest goes on.
        """
        waiting = iter(chunks)
        while suspects := (yield from self._until_death(waiting, self._number)):
            for suspect in suspects:
                if (yield from self._until_death(iter([suspect]), 1)):
                    yield self._give_up(suspect)

    def _give_up(self, chunk: Chunk) -> Tally:
        """Record that a chunk's captures could not be done."""
        reason = f"its process died, alone as well; {RUN_ALONE_HINT}"
        store = open_store(self._job.place)
        assert store is not None
        store.write({number: Entry(FAILED, reason) for number, _ in chunk})
        return Tally(0, len(chunk))

    def _until_death(
        self, chunks: Iterator[Chunk], number: int
    ) -> Generator[Tally, None, list[Chunk]]:
        """Do chunks until none is left, or a process dies; return those that were under way."""
        running: dict[Future[Tally], Chunk] = {}
        ready: list[Chunk] = []
        idle, self._idle = self._idle, None
        with idle or self._start(number) as pool:
            try:
                while True:
                    ready.extend(islice(chunks, number - len(running)))
                    while ready:
                        future = hand_over(pool, self._do, ready[0])
                        running[future] = ready.pop(0)
                    if not running:
                        return []
                    for future in wait(running, return_when=FIRST_COMPLETED).done:
                        tally = future.result()
                        del running[future]
                        yield tally
            except PROCESS_DEATHS:
                return [*running.values(), *ready]
            except (KeyboardInterrupt, GeneratorExit):
                stop_processes()
                raise
            finally:
                pool.shutdown(wait=True, cancel_futures=True)
