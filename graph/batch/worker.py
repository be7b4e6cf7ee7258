"""The work of a worker: it opens the graph once, then does chunk after chunk."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain, pairwise
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from tactograph.graph.batch.entry import DONE, FAILED, Entry
from tactograph.graph.batch.job import Job
from tactograph.graph.batch.map_types import MapType
from tactograph.graph.batch.open_job import forget_pipeline, pipeline_of
from tactograph.graph.batch.store import Store, open_store
from tactograph.graph.errors import DeviceError, InputError, NodeError, TactographError
from tactograph.graph.files.captures_in import CAPTURE_PARAM
from tactograph.graph.run.pipeline import Pipeline
from tactograph.graph.run.result import Result
from tactograph.graph.run.source_stream import SourceStream

Answer = TypeVar("Answer")
PIXEL_UNIT = "mm/px"


@dataclass(frozen=True)
class Chunk:
    """Captures that one worker does and writes together."""

    out: str
    stamp: str
    captures: tuple[tuple[int, str], ...]


@dataclass(frozen=True)
class Tally:
    """The numbers of captures of a chunk that were done and that failed."""

    done: int = 0
    failed: int = 0
    fallbacks: tuple[str, ...] = ()


def do_chunk(chunk: Chunk) -> Tally:
    """Do a chunk by itself; see `do_chunks`."""
    (tally,) = do_chunks([chunk])
    return tally


def do_chunks(chunks: Iterable[Chunk]) -> Iterator[Tally]:
    """Reconstruct the captures of chunks and write them into their store; yield each chunk's tally.

    While a capture is computed, the next one is read and the chunk before is written.  Captures
    that another worker has finished meanwhile are passed over.  A capture that fails is recorded
    with its reason.  Raises InputError if the store has gone, or its graph cannot be opened here.
    """
    with ThreadPoolExecutor(1, "read") as reader, ThreadPoolExecutor(1, "write") as writer:
        written: Future[Tally] | None = None
        entries: dict[int, Entry] = {}
        types: dict[str, MapType] = {}
        # Each turn is taken after the next one is begun.
        for turn, _ in pairwise(chain(_turns(chunks, reader), [None])):
            assert turn is not None
            # After a device failed the pipeline is opened again: it may not recover otherwise.
            store = store_of(turn.chunk.out, turn.chunk.stamp)
            pipeline = pipeline_of(store.job)
            if turn.coming is not None:
                types = types if entries else store.map_types()
                entries[turn.number] = _attempt(pipeline, turn.coming.result(), types)
            if turn.is_last:
                if written is not None:
                    yield written.result()
                fallbacks = tuple(pipeline.plan.fallbacks)
                written = writer.submit(_write, store, turn.chunk, entries, fallbacks)
                entries = {}
        if written is not None:
            yield written.result()


class _Turn(NamedTuple):
    """A capture that is being read, or None where all of a chunk is done."""

    chunk: Chunk
    number: int
    coming: Future[_Ready] | None
    is_last: bool


def _turns(chunks: Iterable[Chunk], reader: ThreadPoolExecutor) -> Iterator[_Turn]:
    """Begin to read every capture that is still to do, on demand."""
    for chunk in chunks:
        store = store_of(chunk.out, chunk.stamp)
        pipeline = pipeline_of(store.job)
        first, last = chunk.captures[0][0], chunk.captures[-1][0]
        statuses = store.statuses_of(slice(first, last + 1))
        to_do = [(n, place) for n, place in chunk.captures if statuses[n - first] != DONE]
        for number, place in to_do:
            coming = reader.submit(_read, pipeline, store.job, place)
            yield _Turn(chunk, number, coming, number == to_do[-1][0])
        if not to_do:
            yield _Turn(chunk, first, None, True)


def _write(
    store: Store, chunk: Chunk, entries: dict[int, Entry], fallbacks: tuple[str, ...]
) -> Tally:
    if entries:
        store.write(entries)
    failed = sum(entry.status == FAILED for entry in entries.values())
    return Tally(len(chunk.captures) - failed, failed, fallbacks)


class Serial:
    """Does one chunk after the other in this process."""

    name = "this process"

    def ask(self, question: Callable[..., Answer], *about: Any) -> Answer:
        """Answer a question here."""
        return question(*about)

    def run(self, chunks: Iterable[Chunk]) -> Iterator[Tally]:
        """Do every chunk, and yield the tally of each."""
        return do_chunks(chunks)


def find_map_types(job: Job, place: str) -> dict[str, MapType]:
    """The types of a job's maps, from a capture.  Raises TactographError if it cannot be done."""
    pipeline = pipeline_of(job)
    result = _run(pipeline, _read(pipeline, job, place))
    return {name: _type_of(result, name) for name in job.maps}


def fail_chunk(chunk: Chunk, reason: str) -> Tally:
    """Record that a chunk's captures could not be done."""
    store = open_store(chunk.out)
    assert store is not None
    store.write({number: Entry(FAILED, reason) for number, _ in chunk.captures})
    return Tally(0, len(chunk.captures))


@lru_cache(maxsize=1)
def store_of(out: str, stamp: str) -> Store:
    """Open the store that a chunk belongs to, once for all its chunks.

    Raises InputError if it has gone, or another is in its place.
    """
    store = open_store(out)
    if store is None or store.stamp != stamp:
        raise InputError(f"{out}: the store of this batch is not there (any more)")
    return store


class _Ready(NamedTuple):
    """A capture that was read, with values of the graph's params, or why it was not."""

    place: str
    aims: dict[str, Any]
    stream: SourceStream | None
    error: TactographError | MemoryError | None = None


def _read(pipeline: Pipeline, job: Job, place: str) -> _Ready:
    """Read a capture, in any thread, while the one before it is computed."""
    aims = {CAPTURE_PARAM: place}
    if job.folders is not None:
        aims["out"] = str(Path(job.folders) / folder_name(place, job.below))
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


def _attempt(pipeline: Pipeline, ready: _Ready, types: dict[str, MapType]) -> Entry:
    start, place = time.perf_counter(), ready.place
    try:
        result = _run(pipeline, ready)
        maps = {name: result[name] for name in types}
        for name, array in maps.items():
            if array.shape != types[name].shape:
                raise InputError(
                    f"{place}: '{name}' is {_by(array.shape)}, but the store holds "
                    f"{_by(types[name].shape)}; give images of another size another --out"
                )
    except DeviceError as error:
        forget_pipeline()
        return Entry(FAILED, str(error))
    except TactographError as error:
        return Entry(FAILED, str(error))
    except MemoryError:
        return Entry(FAILED, f"{place}: out of memory")
    figures = {name: float(figure) for name, figure in result.figures.items()}
    spent = 1e3 * (time.perf_counter() - start)
    return Entry(DONE, "", figures, result.warnings, spent, maps)


def _run(pipeline: Pipeline, ready: _Ready) -> Result:
    if ready.error is not None:
        raise ready.error
    pipeline.aim(**ready.aims)
    results = list(pipeline.items(stream=ready.stream))
    if not results:
        raise InputError(f"{ready.place}: holds no capture")
    results[0].warnings.extend(pipeline.closing_warnings)
    return results[0]


def folder_name(place: str, below: str) -> str:
    """The folder of a capture's results in the batch's folder: its path without the common part."""
    return place.removeprefix(below).lstrip("/")


def _type_of(result: Result, name: str) -> MapType:
    port = result.plan.port(name)
    if result[name] is None:
        raise NodeError(f"{result.plan.graph.name}: its output '{name}' may be absent")
    dims = tuple(str(dim) for dim in port.dims)
    return MapType(result[name].shape, str(result[name].dtype), port.unit, dims, _pixel_of(result))


def _pixel_of(result: Result) -> float | None:
    """The pixel size that the graph puts out, if it puts out one."""
    plan = result.plan
    sizes = [result[name] for name in plan.outputs if plan.port(name).unit == PIXEL_UNIT]
    return float(sizes[0]) if len(sizes) == 1 else None


def _by(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))
