"""Workers on this machine: a pool of processes that survives the death of any of them."""

from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import chain, islice
from typing import Any, Self

from tactograph.graph.batch.fork_server import hand_over, start_processes, stop_processes
from tactograph.graph.batch.worker import Answer, Chunk, Tally, do_chunk, fail_chunk
from tactograph.graph.errors import InputError

MAX_LONE_TRIES = 2
"""Times that a chunk is done alone before it is blamed for the death of its process."""
PROCESS_DEATHS = (BrokenProcessPool, SystemExit)
"""Errors of a chunk whose process was killed or ended by itself."""
RUN_ALONE_HINT = "run this capture alone to see why"


class Processes:
    """A pool of `number` processes, each with a pipeline of its own; `do` does a chunk there.

    They are those of `idle`, which end with the ``with`` block, or start with their first work.
    """

    def __init__(
        self,
        number: int,
        do: Callable[[Chunk], Tally] = do_chunk,
        idle: ProcessPoolExecutor | None = None,
    ) -> None:
        self.number = number
        self._do = do
        self._idle = idle
        self.name = f"{number} processes"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            stop_processes()
        if self._idle is not None:
            self._idle.shutdown(cancel_futures=True)

    def ask(self, question: Callable[..., Answer], *about: Any) -> Answer:
        """Ask all processes, which open the graph for it, and return the first answer.

        Raises InputError if the process dies.
        """
        pool = self._idle = self._idle or start_processes(self.number)
        try:
            answers = [hand_over(pool, question, *about) for _ in range(self.number)]
            return wait(answers, return_when=FIRST_COMPLETED).done.pop().result()
        except PROCESS_DEATHS:
            self._idle = None
            raise InputError(f"{about[-1]}: its process died; {RUN_ALONE_HINT}") from None

    def run(self, chunks: Iterable[Chunk]) -> Iterator[Tally]:
        """Do every chunk, and yield the tally of each.

        When a process dies, every chunk that was under way is done again, alone.  A chunk that
        kills its process every time is so found and recorded as failed; the rest goes on.
        """
        waiting = iter(chunks)
        suspects: list[Chunk] = []
        while True:
            suspects = yield from self._until_death(waiting, self.number)
            if not suspects:
                return
            yield from self._one_by_one(suspects)

    def _one_by_one(self, suspects: list[Chunk]) -> Iterator[Tally]:
        """Do chunks alone; give up one that ends its process every time."""
        waiting, deaths = iter(suspects), Counter[Chunk]()
        while died := (yield from self._until_death(waiting, 1)):
            deaths.update(died)
            if deaths[died[0]] < MAX_LONE_TRIES:
                waiting = chain(died, waiting)
            else:
                yield fail_chunk(
                    died[0], f"its process died {MAX_LONE_TRIES + 1} times; {RUN_ALONE_HINT}"
                )

    def _until_death(
        self, chunks: Iterator[Chunk], number: int
    ) -> Generator[Tally, None, list[Chunk]]:
        """Do chunks until none is left, or a process dies; return those that were under way."""
        running: dict[Future[Tally], Chunk] = {}
        ready: list[Chunk] = []
        idle, self._idle = self._idle, None
        with idle or start_processes(number) as pool:
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
