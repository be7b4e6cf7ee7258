"""Open a graph, for Python or for a command: read, verify, plan and compile it."""

import os
import warnings
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

from tactograph.graph.backends import BACKENDS
from tactograph.graph.backends.device_backend import open_device
from tactograph.graph.cache.cache import Cache
from tactograph.graph.declare.find_node import find_node, own_nodes
from tactograph.graph.declare.node import Node
from tactograph.graph.errors import InputError, did_you_mean, missing
from tactograph.graph.files.changes import plain, with_changes
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.files.read_graph import Source, read_graph
from tactograph.graph.plan.make_plan import make_plan
from tactograph.graph.run.pipeline import Pipeline


def load(
    graph: Source,
    params: Mapping[str, Any] | None = None,
    /,
    *,
    backend: str | None = None,
    device: str | None = None,
    strict: bool = False,
    changes: Mapping[str, Any] | None = None,
    outputs: Collection[str] | None = None,
    to: Literal["host", "device"] = "host",
    cache: Cache | None = None,
    nodes: Iterable[Node] = (),
    **arguments: Any,
) -> Pipeline:
    """Read, verify, plan and compile a graph, to be called with arrays.

    Parameters
    ----------
    graph
        A graph file, the bare name of a pipeline that ships, ``package/name`` of one that a
        package brings, plain data such as a graph file holds, or a `Graph`.
    params
        Those params of the graph whose names are also arguments here, such as ``device``.
    backend
        "numpy" or "opencl", in place of the graph's preference.
    device
        A part of the name of the OpenCL device to use.
    strict
        Refuse to run if a node would fall back to another back end.  A node that is written for the
        host alone does not count as a fallback.
    changes
        ``{"shadow.threshold": 4.0}``: parameters of nodes to change.
    outputs
        Names of the outputs to compute; steps that only the others need do not run.
    to
        "device": arrays among the outputs stay on the device, as ``pyopencl.array.Array``.
    cache
        Keeps results of nodes, so that equal work is done once; pipelines of one thread may
        share it.  Without it a pipeline creates its own cache at the first `set`.
    nodes
        Nodes that the script or notebook defines: functions decorated with `node`.
    **arguments
        The graph's params, such as ``calibration="cal.npz"``.  If the params of a source are not
        given, and it yields a stream or one array, the caller supplies its items:
        ``pipeline(frames=stack)``.

    Returns
    -------
    Pipeline
        Loading warns of each fallback to another back end, with the reason.

    Raises
    ------
    InputError
        If the graph, a value or a file is wrong; the message names the place.

    Examples
    --------
    >>> pipeline = load("reconstruct", calibration="cal.npz")  # doctest: +SKIP
    >>> pipeline(frames=stack)["height"].shape  # doctest: +SKIP
    (480, 640)
    """
    for word, value, kind, needed in (
        ("params", params, Mapping, "a mapping"),
        ("changes", changes, Mapping, "a mapping of 'NODE.PARAM' to values"),
        ("device", device, str, "a part of its name"),
        ("outputs", outputs, Collection, "a list of names"),
        ("cache", cache, Cache, "a `tactograph.sdk.Cache`"),
        ("nodes", nodes, Iterable, "a list of functions decorated with @node"),
    ):
        if value is not None and not isinstance(value, kind):
            raise InputError(f"{word}={value!r}: {needed} is needed")
    for word in arguments.keys() & (params or {}).keys():
        raise InputError(f"{word} is given twice")
    arguments = {**(params or {}), **arguments}
    if to not in ("host", "device"):
        raise InputError(f"to={to!r}: 'host' or 'device'")
    read = read_graph(graph)
    read = replace(read, own={**read.own, **own_nodes(nodes)})
    graph = with_changes(read, {str(name): value for name, value in (changes or {}).items()})
    _check_archives(graph, arguments)
    pipeline = open_pipeline(
        graph,
        arguments,
        backend=backend,
        device=device,
        strict=strict,
        sinks=False,
        cache=cache,
        stand_ins=_stand_ins(graph, arguments),
        outputs=None if outputs is None else _chosen_outputs(graph, outputs),
        stays=to == "device",
    )
    for line in pipeline.plan.fallbacks:
        warnings.warn(f"fallback: {line}", stacklevel=2)
    return pipeline


def open_pipeline(
    graph: Source,
    arguments: Mapping[str, Any],
    *,
    backend: str | None = None,
    device: str | None = None,
    strict: bool = False,
    sinks: bool = True,
    cache: Cache | None = None,
    stand_ins: frozenset[str] = frozenset(),
    outputs: Mapping[str, str] | None = None,
    stays: bool = False,
    no_device: str = "",
    waits: bool = True,
) -> Pipeline:
    """Read, plan and compile a graph; see `load` and `make_plan`.

    `no_device` is a reason to use no device, which results record.  With `waits` false the caller
    does not wait for kernels to be compiled.

    Raises InputError also if `strict` and a node would fall back to another back end; NotBuiltError
    if kernels have to be compiled and the caller does not wait.
    """
    graph = read_graph(graph)
    arguments = {word: plain(value) for word, value in arguments.items()}
    if backend is not None:
        if backend not in BACKENDS:
            raise InputError(f"no back end is called '{backend}'; choose {' or '.join(BACKENDS)}")
        graph = replace(graph, prefer=(backend,))
    open_it = partial(open_device, waits=waits) if cache is None else cache.device
    opened, reason = (None, no_device) if no_device else open_it(graph.backends, device)
    if opened is None and backend not in (None, "numpy"):
        raise InputError(f"--backend {backend}: {reason}; 'tactograph devices' says more")
    if sinks:
        _check_out(graph, arguments)
    plan_options = dict[str, Any](sinks=sinks, stand_ins=stand_ins, outputs=outputs, stays=stays)
    plan = make_plan(graph, arguments, device=opened, no_device=reason, **plan_options)
    if strict and plan.fallbacks:
        raise InputError(f"--strict: {'; '.join(plan.fallbacks)}")
    anew = partial(open_pipeline, backend=backend, device=device, strict=strict, **plan_options)
    return Pipeline(plan, opened, cache, anew)


def _check_archives(graph: Graph, arguments: Mapping[str, Any]) -> None:
    """Refuse a calibration that does not exist, before the first array arrives."""
    for name, place in arguments.items():
        is_path = name in graph.params and graph.params[name].kind == "path" and name != "out"
        if is_path and str(place).endswith(".npz") and not Path(str(place)).is_file():
            raise InputError(f"{name}={missing(Path(str(place)), 'file')}")


def _check_out(graph: Graph, arguments: Mapping[str, Any]) -> None:
    """Refuse to write results over what the graph's params read."""
    params = {name: param for name, param in graph.params.items() if param.kind == "path"}
    places = {name: arguments.get(name, param.default) for name, param in params.items()}
    out = places.pop("out", None)
    if not isinstance(out, str | Path):
        return
    refuse_to_write_over(f"out={out}", out, {f"{n}={place}": place for n, place in places.items()})


def refuse_to_write_over(source: str, out: str | Path, read: Mapping[str, Any]) -> None:
    """Refuse to write results over a place that is read; `read` has places by their words."""
    target = os.path.realpath(out)
    for words, place in read.items():
        # Not Path.resolve, which fails at circular links; their reader names them.
        if isinstance(place, str | Path) and os.path.realpath(place) == target:
            raise InputError(f"{source}: is what {words} reads; give another place")


def _chosen_outputs(graph: Graph, chosen: Collection[str]) -> dict[str, str]:
    if isinstance(chosen, str | bytes) or not chosen:
        raise InputError(f"outputs={chosen!r}: a list of names is needed: {list(graph.outputs)}")
    for name in chosen:
        if not isinstance(name, str):
            raise InputError(f"outputs: {name!r} is not a name; use {', '.join(graph.outputs)}")
        if name not in graph.outputs:
            raise InputError(
                f"{graph.name} has no output '{name}'{did_you_mean(name, graph.outputs)}"
                f" (it has: {', '.join(graph.outputs) or 'none'})"
            )
    return {name: graph.outputs[name] for name in chosen}


def _stand_ins(graph: Graph, arguments: Mapping[str, Any]) -> frozenset[str]:
    """The sources, of a stream or an array, that need a param which was not given.

    Raises InputError if one that is given changes nothing but what these sources would read.
    """
    lacking = graph.placeholders.keys() - arguments.keys()
    ungiven = frozenset(
        node_id
        for node_id, entry in graph.nodes.items()
        if not lacking.isdisjoint(entry.params.values())
        and find_node(entry.op, graph.own).may_be_handed_in
    )
    for name in arguments:
        readers = [n for n, entry in graph.nodes.items() if name in entry.params.values()]
        if readers and ungiven.issuperset(readers):
            raise InputError(
                f"{graph.name}: only {readers[0]} reads {name}=, and it is not run, as its images "
                "are handed in: leave it out, and prepare the images alike"
            )
    return ungiven
