"""Workers on this machine: a pool of processes that survives the death of any of them."""

from __future__ import annotations

import multiprocessing
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import chain, islice

from tactograph.graph.backends.devices import choose_device
from tactograph.graph.batch.job import Job
from tactograph.graph.batch.worker import Chunk, Tally, do_chunk, fail_chunk
from tactograph.graph.run.cores import cores, shared_among

TRIES = 2
"""So often is a chunk done alone before it is held to be what kills its process."""
FEWEST = 256
"""Captures that make up for the start of a process, which takes seconds."""
DIED = f"its process died {TRIES + 1} times; run this capture alone to see why"


def worth_starting(job: Job, captures: int) -> int:
    """How many processes do so many captures soonest.

    One for each core: each does more by itself than with a share of all.  A GPU has one.
    """
    device = choose_device(job.device)[0] if job.computes_on else None
    if device is not None and device.kind != "CPU":
        return 1
    return max(1, min(cores(), captures // FEWEST))


class Processes:
    """A pool of `number` processes, each with a pipeline of its own; `do` does a chunk there."""

    def __init__(self, number: int, do: Callable[[Chunk], Tally] = do_chunk) -> None:
        self.number = number
        self._do = do
        self.name = f"{number} processes"

    def run(self, chunks: Iterable[Chunk]) -> Iterator[Tally]:
        """Do every chunk, and yield how each went.

        When a process dies, every chunk that was under way is done again, alone: so one that
        kills its process each time is found, written down as failed, and the rest goes on.
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
            if deaths[died[0]] < TRIES:
                waiting = chain(died, waiting)
            else:
                yield fail_chunk(died[0], DIED)

    def _until_death(
        self, chunks: Iterator[Chunk], number: int
    ) -> Generator[Tally, None, list[Chunk]]:
        """Do chunks until none is left, or a process dies; return those that were under way."""
        # fork would copy an OpenCL context, which no runtime allows.
        spawn = multiprocessing.get_context("spawn")
        running: dict[Future[Tally], Chunk] = {}
        ready: list[Chunk] = []
        with shared_among(number), ProcessPoolExecutor(number, mp_context=spawn) as pool:
            try:
                while True:
                    ready.extend(islice(chunks, number - len(running)))
                    while ready:
                        future = pool.submit(self._do, ready[0])
                        running[future] = ready.pop(0)
                    if not running:
                        return []
                    for future in wait(running, return_when=FIRST_COMPLETED).done:
                        tally = future.result()
                        del running[future]
                        yield tally
            except BrokenProcessPool:
                return [*running.values(), *ready]
            finally:
                pool.shutdown(wait=True, cancel_futures=True)
