"""A worker: it opens the graph once, then does chunk after chunk."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, pairwise
from pathlib import Path
from typing import Any, NamedTuple

from tactograph.rings.batch.entry import DONE, FAILED, Entry
from tactograph.rings.batch.job import Job
from tactograph.rings.batch.map_types import MapType
from tactograph.rings.batch.store import Store, open_store
from tactograph.sdk import InputError, Pipeline, Result, TactographError

PIXEL_UNIT = "mm/px"


Chunk = list[tuple[int, str]]
"""Captures, by number, that one worker does and writes together."""


@dataclass(frozen=True)
class Tally:
    """The numbers of captures of a chunk that were done and that failed."""

    done: int = 0
    failed: int = 0
    fallbacks: tuple[str, ...] = ()


class _Ready(NamedTuple):
    """A capture that was read, with values of the graph's params, or why it was not."""

    place: str
    aims: dict[str, Any]
    stream: Any = None
    error: TactographError | MemoryError | None = None


class Worker:
    """Does one chunk after the other of a job, in the thread that calls it."""

    name = "this process"

    def __init__(self, job: Job) -> None:
        self._job = job
        self._opened: Pipeline | None = None

    @property
    def _pipeline(self) -> Pipeline:
        if self._opened is None:
            self._opened = self._job.open()
        return self._opened

    def open_ahead(self) -> None:
        """Open the pipeline before it is needed; where it is, an error is raised again."""
        with suppress(TactographError):
            _ = self._pipeline

    @cached_property
    def _store(self) -> Store:
        store = open_store(self._job.place)
        if store is None:
            raise InputError(f"{self._job.place}: the store of this batch is not there (any more)")
        return store

    def map_types(self, place: str) -> dict[str, MapType]:
        """The types of the maps, from a capture.  Raises TactographError if it cannot be done."""
        arrays = self._maps()
        result = self._run(self._read(self._pipeline, place))
        return {name: _type_of(result, name) for name in arrays}

    def _maps(self) -> list[str]:
        """The outputs to keep."""
        plan, map_names = self._pipeline.plan, self._job.maps
        arrays = [
            name
            for name, value in plan.outputs.items()
            if plan.port(name).kind == "array" and not plan.tasks[value.node].conditions
        ]
        for name in map_names or ():
            if name not in arrays:
                message = f"--maps: {plan.graph.name} puts out no array '{name}' of every capture"
                raise InputError.unknown(message, name, arrays)
        if map_names is None:
            return [name for name in arrays if len(plan.port(name).dims) == 2]
        return list(dict.fromkeys(map_names))

    def run(self, chunks: Iterable[Chunk]) -> Iterator[Tally]:
        """Do the captures of chunks and write them into the store; yield each chunk's tally.

        While a capture is computed, the next one is read and the chunk before is written.  A
        capture that fails is recorded with its reason.  Raises InputError if the store has gone, or
        its graph cannot be opened here.
        """
        with ThreadPoolExecutor(1, "read") as reader, ThreadPoolExecutor(1, "write") as writer:
            written: Future[Tally] | None = None
            entries: dict[int, Entry] = {}
            coming = (
                (chunk, number, reader.submit(self._read, self._pipeline, place))
                for chunk in chunks
                for number, place in chunk
            )
            # Each capture's turn is taken after the next one is begun.
            for turn, _next in pairwise(chain(coming, [None])):
                assert turn is not None
                chunk, number, ready = turn
                entries[number] = self._attempt(ready.result())
                if number == chunk[-1][0]:
                    if written is not None:
                        yield written.result()
                    fallbacks = tuple(self._pipeline.plan.fallbacks)
                    written = writer.submit(self._write, entries, fallbacks)
                    entries = {}
            if written is not None:
                yield written.result()

    def _write(self, entries: dict[int, Entry], fallbacks: tuple[str, ...]) -> Tally:
        self._store.write(entries)
        failed = sum(entry.status == FAILED for entry in entries.values())
        return Tally(len(entries) - failed, failed, fallbacks)

    def _read(self, pipeline: Pipeline, place: str) -> _Ready:
        """Read a capture, in any thread, while the one before it is computed."""
        aims, folders = self._job.graph.at_capture(place), self._job.folders
        if folders is not None:
            aims["out"] = str(Path(folders) / folder_name(place, self._store.below))
        try:
            stream = pipeline.begin(**aims)
            if stream is not None and stream.reads_two():
                # Before any is computed, or written.
                stream.close()
                raise InputError(
                    f"{place}: holds several captures; let --over match each of them, as in "
                    f"--over '{place}/*'"
                )
        except (TactographError, MemoryError) as error:
            return _Ready(place, {}, None, error)
        return _Ready(place, aims, stream)

    def _attempt(self, ready: _Ready) -> Entry:
        start, place = time.perf_counter(), ready.place
        try:
            result = self._run(ready)
            maps = {name: result[name] for name in self._store.types}
            for name, array in maps.items():
                if array.shape != (shape := self._store.types[name].shape):
                    raise InputError(
                        f"{place}: '{name}' is {_by(array.shape)}, but the store holds "
                        f"{_by(shape)}; give images of another size another --out"
                    )
        except InputError as error:
            return Entry(FAILED, str(error))
        except TactographError as error:
            self._opened = None  # a device that failed may not recover otherwise
            return Entry(FAILED, str(error))
        except MemoryError:
            return Entry(FAILED, f"{place}: out of memory")
        figures = {name: float(figure) for name, figure in result.figures.items()}
        spent = 1e3 * (time.perf_counter() - start)
        return Entry(DONE, "", figures, result.warnings, spent, maps)

    def _run(self, ready: _Ready) -> Result:
        if ready.error is not None:
            raise ready.error
        self._pipeline.aim(**ready.aims)
        results = list(self._pipeline.items(stream=ready.stream))
        if not results:
            raise InputError(f"{ready.place}: holds no capture")
        results[0].warnings.extend(self._pipeline.closing_warnings)
        return results[0]


def folder_name(place: str, below: str) -> str:
    """The folder of a capture's results in the batch's folder: its path without the common part."""
    return place.removeprefix(below).lstrip("/")


def _type_of(result: Result, name: str) -> MapType:
    port = result.plan.port(name)
    if result[name] is None:
        raise TactographError(f"{result.plan.graph.name}: its output '{name}' may be absent")
    dims = tuple(str(dim) for dim in port.dims)
    return MapType(result[name].shape, str(result[name].dtype), port.unit, dims, _pixel_of(result))


def _pixel_of(result: Result) -> float | None:
    """The pixel size that the graph puts out, if it puts out one."""
    plan = result.plan
    sizes = [result[name] for name in plan.outputs if plan.port(name).unit == PIXEL_UNIT]
    return float(sizes[0]) if len(sizes) == 1 else None


def _by(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))
