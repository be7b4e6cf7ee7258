"""Sweeps: the values that a comparison tries for a node's parameter, and its seeds."""

import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tactograph.graph.declare.find_node import find_node
from tactograph.graph.disk.strict_yaml import Document
from tactograph.graph.errors import InputError
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.files.groups import meant_nodes

MAX_VALUES = 1000
SWEEP_SYNTAX = (
    "write it as node.param=FROM..TO:COUNT, such as 0.01..0.2:10, log:0.01..1:5, or as a,b,c"
)


@dataclass(frozen=True)
class Sweep:
    """The values of one parameter, ``node.param``; `log` if neighbours differ by a factor."""

    target: str
    values: tuple[Any, ...]
    log: bool = False
    text: str = ""


def read_sweep(word: str) -> Sweep:
    """Read ``node.param=from..to:count``, the same with ``log:`` before `from`, or ``a,b,c``.

    A range of whole numbers in whole steps gives whole numbers.

    Raises InputError if the word is not of that form, or the values are fewer than two.
    """
    target, equals, text = word.partition("=")
    if not equals or "." not in target or not re.fullmatch(r"[^\W\d]\w*(\.\w+)*", target):
        raise InputError(f"--sweep {word}: {SWEEP_SYNTAX}")
    log = text.startswith("log:")
    try:
        values = _range(text.removeprefix("log:"), log) if ".." in text else _list(text)
    except (ValueError, InputError) as error:
        raise InputError(f"--sweep {word}: {error}; {SWEEP_SYNTAX}") from None
    if len(set(map(repr, values))) < max(2, len(values)):
        raise InputError(f"--sweep {word}: at least two values, each once, are needed")
    return Sweep(target, values, log, word)


def points(graph: Graph, sweeps: Iterable[Sweep]) -> list[dict[str, Any]]:
    """All combinations of the values that `graph` can be swept over.

    A graph without the node, or with it taken out, is run once for that sweep.
    """
    own_sweeps = [sweep for sweep in sweeps if has_parameter(graph, sweep.target)]
    return [
        dict(zip((sweep.target for sweep in own_sweeps), values, strict=True))
        for values in itertools.product(*(sweep.values for sweep in own_sweeps))
    ]


def seeds(
    graph: Graph, target: str | None, repeats: int, arguments: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """The settings of `repeats` runs with different seeds: the graph's seed, and the next ones.

    Raises InputError if the parameter is not a whole number.
    """
    if target is None or not has_parameter(graph, target):
        return [{}]
    first = _own_value(graph, target, arguments)
    if type(first) is not int:
        raise InputError(f"--seed {target}: a seed is a whole number, not {first!r}")
    return [{target: first + i} for i in range(repeats)]


def check_targets(graphs: Sequence[Graph], targets: Iterable[str], option: str) -> None:
    """Refuse a parameter that none of the graphs has.

    Raises InputError, which lists the nodes, or the parameters of the node.
    """
    for target in targets:
        if not any(has_parameter(graph, target) for graph in graphs):
            raise InputError(f"{option} {target}: {_what_there_is(graphs, target)}")


def has_parameter(graph: Graph, target: str) -> bool:
    """Return whether the graph has this ``node.param``, in a node that is not taken out."""
    node_id, _, name = target.rpartition(".")
    return name in _values_at(graph, node_id)


def seed_like(graphs: Iterable[Graph]) -> list[str]:
    """The parameters called ``seed`` of all nodes."""
    named = ((graph, f"{node_id}.seed") for graph in graphs for node_id in graph.nodes)
    return list(dict.fromkeys(name for graph, name in named if has_parameter(graph, name)))


def _list(text: str) -> tuple[Any, ...]:
    return tuple(Document.scalar(part.strip()) for part in text.split(","))


def _range(text: str, log: bool) -> tuple[float, ...]:
    ends, colon, count_text = text.partition(":")
    low_text, _, high_text = ends.partition("..")
    low, high = (_number(part) for part in (low_text, high_text))
    if not colon or not count_text.isdecimal():
        raise ValueError("the number of values is missing after ':'")
    count = int(count_text)
    if not 2 <= count <= MAX_VALUES:
        raise ValueError(f"from 2 to {MAX_VALUES} values")
    if log and not (low > 0 and high > 0):
        raise ValueError("a logarithmic range starts and ends above 0")
    spaced = np.geomspace(low, high, count) if log else np.linspace(low, high, count)
    whole = isinstance(low, int) and isinstance(high, int) and (spaced % 1 == 0).all()
    # Six digits keep 0.10000000000000002 out of tables and folder names.
    return tuple(int(v) if whole else float(f"{v:.6g}") for v in spaced)


def _number(text: str) -> int | float:
    value = Document.scalar(text.strip())
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"'{text}' is not a number")
    return value


def _values_at(graph: Graph, node_id: str) -> dict[str, Any]:
    """The parameters, with values, of a group, a use, or a node that is not taken out."""
    group = graph.group_of(node_id)
    if group is not None:
        use = graph.uses.get(graph.last_turn(node_id)) if node_id in graph.uses else None
        return {n: use.settings[n] if use else p.default for n, p in group.body.params.items()}
    for entry in map(graph.nodes.__getitem__, meant_nodes(graph, node_id)):
        if not entry.neutral:
            parameters = find_node(entry.op, graph.own).parameters
            return {n: entry.settings.get(n, p.default) for n, p in parameters.items()}
    return {}


def _own_value(graph: Graph, target: str, arguments: Mapping[str, Any]) -> Any:
    node_id, _, name = target.rpartition(".")
    value = _values_at(graph, node_id)[name]
    if isinstance(value, str) and value.startswith("$"):
        return arguments.get(value[1:], graph.params[value[1:]].default)
    return value


def _what_there_is(graphs: Sequence[Graph], target: str) -> str:
    node_id, _, name = target.rpartition(".")
    for graph in graphs:
        names = ", ".join(_values_at(graph, node_id)) or "none"
        if graph.group_of(node_id) is not None:
            return f"'{node_id}' has no param '{name}'; it has: {names}"
        for entry in map(graph.nodes.__getitem__, meant_nodes(graph, node_id)):
            if entry.neutral:
                return f"node '{node_id}' is taken out of every graph"
            return f"node '{node_id}' ({entry.op}) has no parameter '{name}'; it has: {names}"
    nodes = dict.fromkeys(n for graph in graphs for n in graph.nodes)
    return f"no graph has a node '{node_id}'; there are: {', '.join(nodes)}"
