"""A batch: which captures are still to do, cut into chunks, handed to workers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from tactograph.graph.batch.captures import absolute, content_of, is_url
from tactograph.graph.batch.job import Job
from tactograph.graph.batch.map_types import MapType, captures_together
from tactograph.graph.batch.store import DONE, FAILED, Store, create_store, open_store
from tactograph.graph.batch.worker import Answer, Chunk, Tally, find_map_types, folder_name
from tactograph.graph.errors import InputError, TactographError, did_you_mean
from tactograph.graph.files.dump_graph import dump_graph
from tactograph.graph.files.flat_graph import NOT_GIVEN, Graph
from tactograph.graph.plan import names
from tactograph.graph.plan.draft import Draft
from tactograph.graph.run.result_origin import find_origin, named_files

TRIES = 20
"""So many captures are tried to find out what maps look like."""


class Workers(Protocol):
    """Whoever does the chunks."""

    name: str

    def ask(self, question: Callable[..., Answer], *about: Any) -> Answer: ...

    def run(self, chunks: Iterator[Chunk]) -> Iterator[Tally]: ...


def make_job(
    graph: Graph,
    given: Mapping[str, Any],
    *,
    out: str,
    param: str = "capture",
    maps: Sequence[str] | None = None,
    backend: str | None = None,
    device: str | None = None,
    strict: bool = False,
) -> Job:
    """Say what is to be done with every capture.

    Parameters
    ----------
    out
        The store.  If its name does not end in ``.zarr`` it is a folder that takes what the
        graph's own sinks write, by capture, and the store in it holds the rest.
    param
        The graph's parameter that takes a capture.
    maps
        The outputs to keep; None for all that are an H x W map.

    Raises
    ------
    InputError
        If the graph lacks the parameter or a map.
    """
    if param not in graph.params:
        raise InputError(
            f"{graph.name} has no parameter '{param}'{did_you_mean(param, graph.params)} to take "
            f"a capture; say which with --param (it has: {', '.join(graph.params)})"
        )
    if graph.params[param].kind != "path":
        raise InputError(f"--param {param}: {graph.name} takes no file or folder by that name")
    for name, option in ((param, "--over"), ("out", "--out")):
        if name in given:
            raise InputError(f"{name}={given[name]}: in a batch {option} says that; leave it out")
    if not out.strip():
        raise InputError("--out is empty; give NAME.zarr, or a folder")
    folders = None if out.rstrip("/").endswith(".zarr") else absolute(out)
    if folders is not None and (is_url(folders) or "out" not in graph.params):
        raise InputError(
            f"--out {out}: folders are written by the graph's sinks, to a local "
            "place, through its parameter 'out'; else give a store, NAME.zarr"
        )
    paths = {name for name, p in graph.params.items() if p.kind == "path" and name != "out"}
    fixed = {
        name: absolute(value) if name in paths and value is not None else value
        for name, value in given.items()
    }
    draft = _draft(graph, fixed, param, sinks=folders is not None)
    kept = _maps(draft, maps)
    named = {n: str(file) for n, file in named_files(draft, {*fixed, param, "out"}).items()}
    read = {n: str(v) for n, v in fixed.items() if n in paths and v is not None}
    origin = find_origin(graph, backend=backend, device=device)
    return Job(
        graph=dump_graph(graph),
        name=graph.name,
        hash=graph.hash,
        given={**fixed, param: "."},
        inputs={name: content_of(place) for name, place in {**read, **named}.items()},
        param=param,
        maps=() if folders else kept,
        backend=backend,
        device=device,
        strict=strict,
        folders=folders,
        code=origin.code,
        versions=origin.versions,
        computes_on=origin.device,
    )


def store_place(out: str, job: Job) -> str:
    """Where the store of a batch lies."""
    return absolute(out) if job.folders is None else f"{job.folders}/batch.zarr"


def open_batch(
    out: str, job: Job, captures: Sequence[str], workers: Workers, chunk: int | None = None
) -> Store:
    """Make the store, or continue one of the same job; add new captures.

    Where `chunk` does not say how many captures are written together, the size of their maps
    does, which `workers` find out.  A store in which no capture was finished, as a mistake in
    the first command leaves it, is made anew for another job or other captures.  A batch's own
    folder is none of its captures.

    Raises
    ------
    InputError
        If the store was made by another graph, other values or another calibration, or
        cannot be written; or if none of the first captures can be done: then it is not the
        captures.
    """
    place = store_place(out, job)
    wanted = [capture for capture in captures if not _lies_in(capture, place, job.folders)]
    if not wanted:
        raise InputError(f"--over: nothing is there but what lies in --out {out}")
    store = open_store(place)
    if store is None or _holds_nothing_for(store, job, wanted, chunk or store.chunk):
        types = _map_types(job, wanted, workers) if job.maps else {}
        together = chunk or captures_together(types.values())
        store = create_store(place, job, together, overwrite=store is not None)
        store.add_maps(types)
    elif store.job.identity != job.identity:
        raise InputError(
            f"{place}: was made with {_differences(store.job.identity, job.identity)}; "
            "give another --out, or remove it"
        )
    elif chunk and chunk != store.chunk:
        raise InputError(f"{place}: was made with --chunk {store.chunk}; leave --chunk out")
    there = set(store.captures)
    store.append([capture for capture in wanted if capture not in there])
    return store


def _lies_in(capture: str, place: str, folders: str | None) -> bool:
    """Whether a match is what this batch itself writes: its store or its table."""
    table = f"{folders}/captures.csv" if folders else f"{place.removesuffix('.zarr')}.csv"
    return capture == table or f"{capture}/".startswith(f"{place.rstrip('/')}/")


def _holds_nothing_for(store: Store, job: Job, captures: Sequence[str], chunk: int) -> bool:
    """Whether nothing is lost, and something put right, if the store is made anew."""
    if store.statuses.any():
        return False
    differs = store.job.identity != job.identity or store.chunk != chunk
    return differs or set(store.captures).isdisjoint(captures)


def reopen_damaged(store: Store) -> int:
    """Let what is called done, but is not there whole, count as never done; return how many."""
    damaged = set(store.damaged())
    if store.job.folders is not None:
        done = zip(store.captures, store.statuses, strict=True)
        damaged.update(
            number
            for number, (capture, status) in enumerate(done)
            if status == DONE and not _has_results(store.job.folders, capture)
        )
    store.reopen(sorted(damaged))
    return len(damaged)


def _has_results(folders: str, capture: str) -> bool:
    folder = Path(folders) / folder_name(capture)
    return folder.is_dir() and any(folder.iterdir())


def open_chunks(place: str, store: Store, *, retry_failed: bool) -> list[Chunk]:
    """The chunks in which captures are still to do."""
    finished = (DONE,) if retry_failed else (DONE, FAILED)
    statuses, captures = store.statuses, store.captures
    chunks: dict[int, list[tuple[int, str]]] = {}
    for number, status in enumerate(statuses):
        if status not in finished:
            chunks.setdefault(number // store.chunk, []).append((number, captures[number]))
    return [Chunk(place, store.stamp, tuple(each)) for each in chunks.values()]


def run_batch(
    place: str, store: Store, chunks: Sequence[Chunk], workers: Workers
) -> Iterator[Tally]:
    """Do the chunks, and yield how each went as soon as it is written.

    Raises
    ------
    InputError
        If maps are gone from the store, and none of the first captures can be done.
    """
    if chunks and not store.has_maps:
        first = [capture for chunk in chunks for _, capture in chunk.captures]
        store.add_maps(_map_types(store.job, first, workers))
    yield from workers.run(iter(chunks))


def _map_types(job: Job, captures: Sequence[str], workers: Workers) -> dict[str, MapType]:
    """What maps look like, from the first of the captures that can be done."""
    reason, tried = "", captures[:TRIES]
    for capture in tried:
        try:
            return workers.ask(find_map_types, job, capture)
        except TactographError as error:
            reason = str(error)
    raise InputError(f"none of the first {len(tried)} captures can be done; the last: {reason}")


def _draft(graph: Graph, given: Mapping[str, Any], param: str, *, sinks: bool) -> Draft:
    """The graph's nodes and settings, once it is sure that no param but the capture is missing."""
    each = {name: NOT_GIVEN for name in (param, "out") if name in graph.params}
    return names.bind(graph, {**given, **each}, sinks=sinks, stand_ins=frozenset())


def _maps(draft: Draft, wanted: Sequence[str] | None) -> tuple[str, ...]:
    """The outputs to keep."""
    graph = draft.graph
    ports = {
        name: draft.tasks[value.node].node.outputs[value.port]
        for name, value in draft.outputs.items()
    }
    arrays = [name for name, port in ports.items() if port.kind == "array"]
    for name in wanted or ():
        if name not in arrays:
            raise InputError(
                f"--maps: {graph.name} puts out no array '{name}'{did_you_mean(name, arrays)} "
                f"(it puts out: {', '.join(arrays)})"
            )
    maps = wanted or (name for name in arrays if len(ports[name].dims) == 2)
    return tuple(dict.fromkeys(maps))


def _differences(then: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    words = {
        "hash": "another graph",
        "inputs": "another content of",
        "given": "other values of",
        "code": "other code of",
        "versions": "another version of",
        "computes_on": f"another device ({then['computes_on'] or 'none'})",
    }
    found = []
    for name in then:
        if then[name] == now[name]:
            continue
        if isinstance(then[name], dict):
            keys = sorted(
                k for k in {*then[name], *now[name]} if then[name].get(k) != now[name].get(k)
            )
            found.append(f"{words[name]} {', '.join(keys)}")
        else:
            found.append(words.get(name, f"another {name} ({then[name]})"))
    return " and ".join(found)
