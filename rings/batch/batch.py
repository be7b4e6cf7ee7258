"""A batch: the captures that are still to do, in chunks for the workers."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from tactograph.rings.batch.entry import DONE, FAILED
from tactograph.rings.batch.job import Job
from tactograph.rings.batch.map_types import MapType, captures_together
from tactograph.rings.batch.store import Store, create_store, open_store
from tactograph.rings.batch.worker import Chunk, Tally, folder_name
from tactograph.sdk import InputError, TactographError

MAX_TRIED_CAPTURES = 20
"""Captures that are tried to learn the types of the maps."""


class Workers(Protocol):
    """This process, or several, that do the chunks of a job."""

    name: str

    def map_types(self, place: str) -> dict[str, MapType]: ...

    def run(self, chunks: Iterator[Chunk]) -> Iterator[Tally]: ...


def open_batch(
    job: Job, origin: Mapping[str, Any], captures: Sequence[str], workers: Workers
) -> Store:
    """Make the store, or continue one of the same job; add new captures.

    The size of the maps, which `workers` find out, decides how many captures are written together.
    A store without a finished capture, as a mistake in the first command leaves it, is made anew
    for another job or other captures.  The batch's own folder is not a capture.

    Raises InputError if the store was made by another graph, other values or another calibration,
    or cannot be written; or if none of the first captures can be done.
    """
    to_do = [capture for capture in captures if not lies_in(capture, job)]
    if not to_do:
        raise InputError(f"--over: it holds nothing but --out {job.folders or job.place}")
    store, identity = open_store(job.place), job.identity(origin)
    if store is None or _holds_nothing_for(store, identity, to_do):
        types = {} if job.folders else _map_types(to_do, workers)
        together = captures_together(types.values())
        store = create_store(job, origin, types, together, overwrite=store is not None)
    elif store.identity != identity:
        raise InputError(
            f"{job.place}: was made with {_differences(store.identity, identity)}"
            f"{_other_sensors(store.inputs, identity['inputs'])}; give another --out, or remove it"
        )
    stored = set(store.captures)
    added = [capture for capture in to_do if capture not in stored]
    # Else their results would lie outside the folder of the first ones.
    for capture in added if store.below else ():
        if not capture.startswith(f"{store.below.rstrip('/')}/"):
            raise InputError(
                f"{capture}: the captures of {job.folders} lie below {store.below}, and so do the "
                "folders of their results; give another --out"
            )
    store.append(added)
    return store


def lies_in(capture: str, job: Job) -> bool:
    """Return whether a match is this batch's own store or table."""
    return capture == table_of(job) or f"{capture}/".startswith(f"{job.place}/")


def table_of(job: Job) -> str:
    """The place of the table."""
    return f"{job.folders or job.place.removesuffix('.zarr')}{'/captures' * bool(job.folders)}.csv"


def _holds_nothing_for(store: Store, identity: Mapping[str, Any], captures: Sequence[str]) -> bool:
    """Return whether the store differs from what is wanted, and holds no finished capture."""
    if store.statuses.any():
        return False
    return store.identity != identity or set(store.captures).isdisjoint(captures)


def reopen_damaged(store: Store) -> int:
    """Reopen the captures that are marked done but are not whole; return their number."""
    damaged = set(store.damaged())
    if (out := store.identity["folders"]) is not None:
        folders = [Path(out, folder_name(capture, store.below)) for capture in store.captures]
        done = (int(number) for number in np.flatnonzero(store.statuses == DONE))
        # An empty folder holds no results either.
        damaged.update(number for number in done if not any(folders[number].glob("*")))
    store.reopen(sorted(damaged))
    return len(damaged)


def open_chunks(store: Store, *, retry_failed: bool) -> list[Chunk]:
    """The chunks in which captures are still to do."""
    finished = (DONE,) if retry_failed else (DONE, FAILED)
    chunks: dict[int, Chunk] = {}
    for number, (status, capture) in enumerate(zip(store.statuses, store.captures, strict=True)):
        if status not in finished:
            chunks.setdefault(number // store.chunk, []).append((number, capture))
    return [*chunks.values()]


def _map_types(captures: Sequence[str], workers: Workers) -> dict[str, MapType]:
    """The types of the maps, from the first capture that can be done."""
    reason, first = "", captures[:MAX_TRIED_CAPTURES]
    for capture in first:
        try:
            return workers.map_types(capture)
        except TactographError as error:
            reason = str(error)
    none = f"none of the first {len(first)} captures can" if first[1:] else "the capture cannot"
    raise InputError(f"{none} be processed: {reason}")


def _other_sensors(then: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Name the sensors of a store and of a command, where these differ."""
    pairs = [(then.get(name, {}), about) for name, about in now.items()]
    named = [(a["sensor"], b["sensor"]) for a, b in pairs if "sensor" in a and "sensor" in b]
    return "".join(f", for sensor '{a}' and not '{b}'" for a, b in named if a != b)


def _differences(then: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """What differs: of mappings the keys, of all else what it was."""
    differences = []
    for name, was in then.items():
        if was == now[name]:
            continue
        parts = ["not given" if was is None else str(was or "none")]
        if isinstance(was, dict):
            keys = {*was, *now[name]}
            parts = sorted(key for key in keys if was.get(key) != now[name].get(key))
        named = "graph" if name == "hash" else name
        differences.append(f"other {named} ({', '.join(parts)})")
    return " and ".join(differences)
