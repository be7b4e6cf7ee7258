"""A batch: the captures that are still to do, in chunks for the workers."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from tactograph.graph.batch.entry import DONE, FAILED
from tactograph.graph.batch.job import Job, identity_of, store_place
from tactograph.graph.batch.map_types import MapType, captures_together
from tactograph.graph.batch.store import Store, create_store, open_store
from tactograph.graph.batch.worker import Answer, Chunk, Tally, find_map_types, folder_name
from tactograph.graph.cache.result_origin import Origin
from tactograph.graph.errors import InputError, TactographError

MAX_TRIED_CAPTURES = 20
"""Captures that are tried to learn the types of the maps."""


class Workers(Protocol):
    """This process, or several, that do the chunks."""

    name: str

    def ask(self, question: Callable[..., Answer], *about: Any) -> Answer: ...

    def run(self, chunks: Iterator[Chunk]) -> Iterator[Tally]: ...


def open_batch(
    out: str,
    job: Job,
    origin: Origin,
    captures: Sequence[str],
    workers: Workers,
    chunk: int | None = None,
) -> Store:
    """Make the store, or continue one of the same job; add new captures.

    Without `chunk`, the size of the maps, which `workers` find out, decides how many captures are
    written together.  A store without a finished capture, as a mistake in the first command leaves
    it, is made anew for another job or other captures.  The batch's own folder is not a capture.

    Raises InputError if the store was made by another graph, other values or another calibration,
    or cannot be written; or if none of the first captures can be done.
    """
    place = store_place(out, job)
    to_do = [capture for capture in captures if not lies_in(capture, place, job.folders)]
    if not to_do:
        raise InputError(f"--over: it holds nothing but --out {out}")
    store = open_store(place)
    identity = identity_of(job, origin)
    if store is None or _holds_nothing_for(store, identity, to_do, chunk or store.chunk):
        types = _map_types(job, to_do, workers) if job.maps else {}
        together = chunk or captures_together(types.values())
        store = create_store(place, job, origin, together, overwrite=store is not None)
        store.add_maps(types)
    elif store.identity != identity:
        raise InputError(
            f"{place}: was made with {_differences(store.identity, identity)}"
            f"{_other_sensors(store.job, job)}; give another --out, or remove it"
        )
    elif chunk and chunk != store.chunk:
        raise InputError(f"{place}: was made with --chunk {store.chunk}; leave --chunk out")
    stored = set(store.captures)
    added = [capture for capture in to_do if capture not in stored]
    _refuse_outside(added, store.job, out)
    store.append(added)
    return store


def _refuse_outside(captures: Sequence[str], job: Job, out: str) -> None:
    """Refuse captures whose results would lie outside the folder of the first ones."""
    for capture in captures:
        if job.below and not capture.startswith(f"{job.below.rstrip('/')}/"):
            raise InputError(
                f"{capture}: the captures of {out} lie below {job.below}, and so do the folders of "
                "their results; give another --out"
            )


def lies_in(capture: str, place: str, folders: str | None) -> bool:
    """Return whether a match is this batch's own store or table."""
    table = f"{folders}/captures.csv" if folders else f"{place.removesuffix('.zarr')}.csv"
    return capture == table or f"{capture}/".startswith(f"{place.rstrip('/')}/")


def _holds_nothing_for(
    store: Store, identity: Mapping[str, Any], captures: Sequence[str], chunk: int
) -> bool:
    """Return whether the store differs from what is wanted, and holds no finished capture."""
    if store.statuses.any():
        return False
    differs = store.identity != identity or store.chunk != chunk
    return differs or set(store.captures).isdisjoint(captures)


def reopen_damaged(store: Store) -> int:
    """Reopen the captures that are marked done but are not whole; return their number."""
    damaged = set(store.damaged())
    folders, below = store.job.folders, store.job.below
    if folders is not None:
        runs = zip(store.captures, store.statuses, strict=True)
        damaged.update(
            number
            for number, (capture, status) in enumerate(runs)
            # An empty folder holds no results either.
            if status == DONE and not any(Path(folders, folder_name(capture, below)).glob("*"))
        )
    store.reopen(sorted(damaged))
    return len(damaged)


def open_chunks(place: str, store: Store, *, retry_failed: bool) -> list[Chunk]:
    """The chunks in which captures are still to do."""
    finished = (DONE,) if retry_failed else (DONE, FAILED)
    statuses, captures = store.statuses, store.captures
    chunks: dict[int, list[tuple[int, str]]] = {}
    for number, status in enumerate(statuses):
        if status not in finished:
            chunks.setdefault(number // store.chunk, []).append((number, captures[number]))
    return [Chunk(place, store.stamp, tuple(each)) for each in chunks.values()]


def run_batch(store: Store, chunks: Sequence[Chunk], workers: Workers) -> Iterator[Tally]:
    """Do the chunks, and yield the tally of each as soon as it is written.

    Raises InputError if maps are gone from the store, and none of the first captures can be done.
    """
    if chunks and not store.has_maps:
        first = [capture for chunk in chunks for _, capture in chunk.captures]
        store.add_maps(_map_types(store.job, first, workers))
    yield from workers.run(iter(chunks))


def _map_types(job: Job, captures: Sequence[str], workers: Workers) -> dict[str, MapType]:
    """The types of the maps, from the first capture that can be done."""
    reason, first = "", captures[:MAX_TRIED_CAPTURES]
    for capture in first:
        try:
            return workers.ask(find_map_types, job, capture)
        except TactographError as error:
            reason = str(error)
    none = f"none of the first {len(first)} captures can" if first[1:] else "the capture cannot"
    raise InputError(f"{none} be processed: {reason}")


def _other_sensors(then: Job, now: Job) -> str:
    """Name the sensors of a store and of a command, where these differ."""
    pairs = [(then.files.get(name, {}), identity) for name, identity in now.files.items()]
    named = [(a["sensor"], b["sensor"]) for a, b in pairs if "sensor" in a and "sensor" in b]
    return "".join(f", for sensor '{a}' and not '{b}'" for a, b in named if a != b)


def _differences(then: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    words = {
        "hash": "another graph",
        "inputs": "another content of",
        "given": "other values of",
        "code": "other code of",
        "versions": "another version of",
        "device": f"another device ({then['device'] or 'none'})",
        "backend": f"another --backend ({then['backend'] or 'none'})",
        "maps": f"other maps ({', '.join(then['maps']) or 'none'})",
        "folders": f"another folder of results ({then['folders'] or 'none'})",
    }
    differences = []
    for name in then:
        if then[name] == now[name]:
            continue
        if isinstance(then[name], dict):
            keys = sorted(
                k for k in {*then[name], *now[name]} if then[name].get(k) != now[name].get(k)
            )
            differences.append(f"{words[name]} {', '.join(keys)}")
        else:
            differences.append(words[name])
    return " and ".join(differences)
