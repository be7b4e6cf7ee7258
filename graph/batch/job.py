"""The work on every capture of a batch."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from tactograph.graph.batch.captures import absolute
from tactograph.graph.cache.result_origin import Origin, named_files
from tactograph.graph.declare.check_settings import PARAM_PLACEHOLDER
from tactograph.graph.disk.content_hash import content_hash
from tactograph.graph.disk.file_identity import identities
from tactograph.graph.disk.text_names import refuse_other_names
from tactograph.graph.errors import InputError, did_you_mean
from tactograph.graph.files.captures_in import CAPTURE_PARAM
from tactograph.graph.files.dump_graph import dump_graph
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.plan import names
from tactograph.graph.plan.draft import Draft


@dataclass(frozen=True)
class Job:
    """The work on a capture.

    `graph` is the text of the flat graph file.  `inputs` are content hashes of the files that all
    captures share, `files` what the ``.npz`` files among these say of themselves.  `folders` is
    the folder for result folders, which mirror the layout of the folder `below`; None if maps go
    into the store.
    """

    graph: str
    name: str
    hash: str
    given: dict[str, Any]
    inputs: dict[str, str]
    maps: tuple[str, ...]
    backend: str | None = None
    device: str | None = None
    strict: bool = False
    folders: str | None = None
    below: str = ""
    files: dict[str, dict[str, str]] = field(default_factory=dict)


def identity_of(job: Job, origin: Origin) -> dict[str, Any]:
    """All that decides a capture's results, and must not change between the parts of a store."""
    same = ("hash", "given", "inputs", "maps", "backend", "folders")
    return {name: value for name, value in asdict(job).items() if name in same} | asdict(origin)


def make_job(
    graph: Graph,
    given: Mapping[str, Any],
    *,
    out: str,
    maps: Sequence[str] | None = None,
    backend: str | None = None,
    device: str | None = None,
    strict: bool = False,
    below: str = "",
) -> Job:
    """Make the job for every capture; see `Job`.

    If the name of `out` does not end in ``.zarr``, it is a folder for the files of the graph's own
    sinks, by capture, and the store in it holds the rest.  Without `maps`, all outputs that are an
    H x W map are kept.  Raises InputError if the graph lacks the parameter or a map, or `out`
    cannot be.
    """
    _check_params(graph, given)
    folders = _folders(graph, out)
    paths = {name for name, p in graph.params.items() if p.kind == "path" and name != "out"}
    read = {n: absolute(v) for n, v in given.items() if n in paths and v is not None}
    fixed = {**given, **read}
    of_each = {name: PARAM_PLACEHOLDER for name in (CAPTURE_PARAM, "out") if name in graph.params}
    draft = names.bind(graph, {**fixed, **of_each}, sinks=folders is not None)
    map_names = _maps(draft, maps)
    named = {n: str(file) for n, file in named_files(draft, {*fixed, CAPTURE_PARAM, "out"}).items()}
    return Job(
        graph=dump_graph(graph),
        name=graph.name,
        hash=graph.hash,
        given={**fixed, CAPTURE_PARAM: "."},
        inputs={name: content_hash(Path(place)) for name, place in {**read, **named}.items()},
        maps=() if folders else map_names,
        backend=backend,
        device=device,
        strict=strict,
        folders=folders,
        below="" if folders is None else below,
        files=identities(read),
    )


def _check_params(graph: Graph, given: Mapping[str, Any]) -> None:
    """Refuse a graph that takes no capture, and values that the batch sets itself."""
    if CAPTURE_PARAM not in graph.params or graph.params[CAPTURE_PARAM].kind != "path":
        raise InputError(
            f"{graph.name} has no parameter '{CAPTURE_PARAM}' for the folder of a capture"
            f" (it has: {', '.join(graph.params)})"
        )
    for name, option in ((CAPTURE_PARAM, "--over"), ("out", "--out")):
        if name in given:
            raise InputError(f"{name}={given[name]}: in a batch {option} says that; leave it out")


def _folders(graph: Graph, out: str) -> str | None:
    """The folder for result folders; None if `out` is a store."""
    if not out.strip():
        raise InputError("--out is empty; give NAME.zarr, or a folder")
    refuse_other_names(out)
    if out.rstrip("/").endswith(".zarr"):
        return None
    folders = absolute(out)
    if "out" not in graph.params:
        raise InputError(
            f"--out {out}: folders are written by the graph's sinks, through its parameter 'out'; "
            "else give a store, NAME.zarr"
        )
    return folders


def store_place(out: str, job: Job) -> str:
    """The place of a batch's store."""
    return absolute(out) if job.folders is None else f"{job.folders}/batch.zarr"


def _maps(draft: Draft, wanted: Sequence[str] | None) -> tuple[str, ...]:
    """The outputs to keep."""
    graph = draft.graph
    ports = {name: draft.port_of(value) for name, value in draft.outputs.items()}
    conditional = [name for name, v in draft.outputs.items() if draft.tasks[v.node].conditions]
    arrays = [n for n, port in ports.items() if port.kind == "array" and n not in conditional]
    for name in wanted or ():
        if name not in arrays:
            raise InputError(
                f"--maps: {graph.name} puts out no array '{name}' of every capture"
                f"{did_you_mean(name, arrays)} "
                f"(it puts out: {', '.join(arrays)})"
            )
    maps = wanted or (name for name in arrays if len(ports[name].dims) == 2)
    return tuple(dict.fromkeys(maps))
