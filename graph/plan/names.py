"""Pass 1: find every node, resolve every reference and parameter, and refuse cycles."""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from tactograph.graph.declare.check_settings import check_settings
from tactograph.graph.declare.find_node import find_node
from tactograph.graph.declare.node import Node
from tactograph.graph.declare.ports import (
    CONDITION_INPUT,
    ENGINE_INPUTS,
    RESTING_INPUT,
    record_ports,
)
from tactograph.graph.errors import ErrorsTogether, GraphError, InputError, did_you_mean
from tactograph.graph.files.flat_graph import (
    PREVIOUS_ITEM,
    Entry,
    Graph,
    split_previous,
    split_reference,
)
from tactograph.graph.files.groups import flat_reference
from tactograph.graph.plan.before import Before, find_cycle, in_order, with_all_before
from tactograph.graph.plan.draft import Draft, Task, Value


def bind(
    graph: Graph,
    arguments: Mapping[str, Any],
    *,
    sinks: bool,
    stand_ins: frozenset[str] = frozenset(),
    outputs: Mapping[str, str] | None = None,
) -> Draft:
    """Turn the names in a graph into nodes, values and checked parameters; see `make_plan`.

    Raises GraphError, with its place, if the graph is wrong; InputError if a param is missing or
    unknown.
    """
    for name in arguments:
        graph.check_param(name)
    names = _Names(graph, ErrorsTogether.of_all(graph.nodes, partial(_find, graph)), {})
    _refuse_wrong_stand_ins(names, stand_ins)
    names.passed.update(_passed_through(names))
    stays = (name for name in graph.nodes if name not in names.passed)
    tasks = ErrorsTogether.of_all(stays, partial(_task, names))
    before = {task.id: _read_by(task) for task in tasks.values()}
    _refuse_cycles(graph, tasks, before)
    references = graph.outputs if outputs is None else outputs
    values = {name: _output(names, name, reference) for name, reference in references.items()}
    needed = {value.node for value in values.values()}
    needed |= {name for name, task in tasks.items() if task.node.sink} if sinks else set()
    if not needed:
        raise GraphError(f"{graph.name}: nothing to do: the graph has neither outputs nor sinks")
    recalled = {name: {v.node for v in task.recalls.values()} for name, task in tasks.items()}
    live = with_all_before({name: before[name] | recalled[name] for name in tasks}, needed)
    unused = [name for name in tasks if name not in live]
    tasks = {name: task for name, task in tasks.items() if name in live}
    # The source of a stream yields all items itself, so no array can stand in beside it.
    has_stream = any(tasks[name].node.stream for name in live - stand_ins)
    errors = ErrorsTogether()
    for task in tasks.values():
        task.stand_in = task.id in stand_ins and not has_stream
        with errors.gathered():
            if not task.stand_in:
                task.settings = settings_of(task.entry, graph, task.node, arguments)
    errors.raise_any()
    ordered = [tasks[name] for name in in_order(before) if name in tasks]
    _mark_streams(ordered, before)
    for task in ordered:
        task.conditions = _conditions(tasks, task)
    _check_recalls(tasks)
    return Draft(graph, tasks, values, names.passed, unused)


def _read_by(task: Task) -> set[str]:
    """The tasks whose values of the same item a task reads, or takes over if it rests."""
    makers = {value.node for value in (*task.reads.values(), task.when) if value}
    return makers if task.instead is None else makers | {task.instead}


class _Names(NamedTuple):
    """The nodes by name, and for nodes taken out (`passed`) the values that they pass on."""

    graph: Graph
    nodes: dict[str, Node]
    passed: dict[str, Value]

    def resolve(self, reference: str, where: str) -> Value:
        """The output that a reference reads; nodes that are taken out are skipped."""
        value = self.value(reference, where)
        hops = 0
        while value.node in self.passed:
            value, hops = self.passed[value.node], hops + 1
            if hops > len(self.passed):
                raise GraphError(f"{where}: the neutral nodes pass on one another in a cycle")
        return value

    def value(self, reference: str, where: str) -> Value:
        """The output that a reference names."""
        source, port = split_reference(reference, {**self.graph.nodes, **self.graph.removed})
        self.graph.check_node(source, where)
        stands = self.graph.stands(source, where)
        return Value.of(source, port, self.nodes[source].outputs, where, stands)


def _find(graph: Graph, node_id: str) -> Node:
    entry = graph.nodes[node_id]
    if PREVIOUS_ITEM in node_id.split("."):
        raise GraphError(f"{entry.where()}: no node can be called '{PREVIOUS_ITEM}'")
    try:
        return find_node(entry.op, graph.own).with_inputs(
            n for n in entry.inputs if n not in ENGINE_INPUTS
        )
    except InputError as error:
        raise GraphError(f"{entry.where('op')}: {error}") from None


def _refuse_wrong_stand_ins(names: _Names, stand_ins: Iterable[str]) -> None:
    sources = [name for name, node in names.nodes.items() if node.may_be_handed_in]
    for name in stand_ins:
        if name not in sources:
            raise InputError(
                f"{names.graph.name} has no source node '{name}'; it has: {', '.join(sources)}"
            )


def _passed_through(names: _Names) -> dict[str, Value]:
    """The nodes taken out whose neutral is an input, with the value that each passes on."""
    passed: dict[str, Value] = {}
    for node_id, entry in names.graph.nodes.items():
        node = names.nodes[node_id]
        if not entry.neutral:
            continue
        if node.neutral is None:
            raise GraphError(
                f"{entry.where('neutral')}: node '{node.name}' has no neutral value; "
                "replace or remove it instead"
            )
        if isinstance(node.neutral, str):
            if node.neutral not in entry.inputs:
                raise GraphError(
                    f"{entry.where('in')}: node '{node.name}' needs the input '{node.neutral}', "
                    "which is passed on"
                )
            where = entry.where(f"in.{node.neutral}")
            passed[node_id] = names.value(entry.inputs[node.neutral], where)
    return passed


def _task(names: _Names, node_id: str) -> Task:
    """A node with the values that it reads, and those that it recalls from the previous item."""
    entry, node = names.graph.nodes[node_id], names.nodes[node_id]
    _refuse_unknown_inputs(entry, node)
    reads: dict[str, Value] = {}
    recalls: dict[str, Value] = {}
    for name, reference in entry.inputs.items():
        if name in ENGINE_INPUTS:
            continue
        where = entry.where(f"in.{name}")
        bare, previous = split_previous(reference)
        if previous and name not in node.optional_inputs:
            raise GraphError(
                f"{where}: the input '{name}' of {node.name} is required, and the first item has "
                f"no previous value; only an optional input can read '{reference}'"
            )
        if previous:
            recalls[name] = names.resolve(bare, where)
        elif name in node.input_records:
            reads |= _record(names, name, reference, node, where)
        else:
            reads[name] = names.resolve(reference, where)
    if node.repeated is not None:
        raise GraphError(f"{entry.where('in')}: node '{node.name}' needs at least one input")
    given = {*entry.inputs, *node.optional_inputs}
    if lacking := [f"'{name}'" for name in node.input_names if name not in given]:
        which = f"the input{'s' * (len(lacking) > 1)} {', '.join(lacking)}"
        raise GraphError(f"{entry.where('in')}: node '{node.name}' needs {which}")
    when, instead = _condition(names, node_id), _instead(names, node_id)
    return Task(node_id, node, entry, {}, reads, recalls, when=when, instead=instead)


def _condition(names: _Names, node_id: str) -> Value | None:
    """The value of a node's `when`, or None."""
    entry = names.graph.nodes[node_id]
    if CONDITION_INPUT not in entry.inputs:
        return None
    where, (bare, previous) = entry.where("in.when"), split_previous(entry.inputs[CONDITION_INPUT])
    value = names.resolve(bare, where)
    port = names.nodes[value.node].outputs[value.port]
    counts = port.kind == "number" or port.python in (bool, int)
    if not counts and (port.dtype is None or port.dtype.kind == "f"):
        raise GraphError(
            f"{where}: a condition is a count, true or false, or an array of integers; {value} is "
            f"{port}"
        )
    if previous or names.nodes[node_id].stream:
        why = "a condition cannot be a previous value" if previous else "a stream has no condition"
        raise GraphError(f"{where}: {why}")
    return value


def _instead(names: _Names, node_id: str) -> str | None:
    """The node of a node's `else`, whose values replace its own if it rests, or None."""
    entry = names.graph.nodes[node_id]
    other = entry.inputs.get(RESTING_INPUT)
    if other is None:
        return None
    where = entry.where(f"in.{RESTING_INPUT}")
    names.graph.check_node(other, where)
    if CONDITION_INPUT not in entry.inputs:
        raise GraphError(f"{where}: '{RESTING_INPUT}' needs '{CONDITION_INPUT}'")
    if names.nodes[other].outputs != names.nodes[node_id].outputs or other in names.passed:
        raise GraphError(f"{where}: '{other}' has other outputs than '{node_id}'")
    return other


def _conditions(tasks: Mapping[str, Task], task: Task) -> tuple[Value, ...]:
    """The conditions of a task, and of the tasks whose values it requires."""
    conditions = dict.fromkeys([task.when] if task.when else [])
    for name, value in task.reads.items():
        optional = {name, name.partition(".")[0]} & task.node.optional_inputs
        needed = not (optional or task.node.inputs[name].optional)
        maker = tasks[value.node]
        while maker.instead is not None:
            maker = tasks[maker.instead]
        conditions |= dict.fromkeys(maker.conditions) if needed else {}
    return tuple(conditions)


def _refuse_unknown_inputs(entry: Entry, node: Node) -> None:
    names = list(dict.fromkeys([*node.input_names, *node.further_names]))
    for name in entry.inputs:
        if name not in names and name not in ENGINE_INPUTS:
            raise GraphError(
                f"{entry.where(f'in.{name}')}: node '{node.name}' has no input '{name}'"
                f"{did_you_mean(name, names)} (it takes: {', '.join(names) or 'none'})"
            )


def _record(names: _Names, name: str, reference: str, node: Node, where: str) -> dict[str, Value]:
    graph = names.graph
    source, port = split_reference(reference, graph.nodes)
    graph.check_node(source, where)
    record = node.input_records[name]
    fields, offered = record_ports(record), names.nodes[source].outputs
    needed = [field for field, port_type in fields.items() if not port_type.optional]
    none_of_it, amount = fields.keys().isdisjoint(offered), "all" if needed else "something"
    if port is not None or none_of_it or not set(needed) <= offered.keys():
        raise GraphError(
            f"{where}: '{name}' takes a node that gives {amount} of a {record.__name__} "
            f"({', '.join(needed or fields)}); '{reference}' is not one"
            f"{graph.stands(source, where)}"
        )
    return {f"{name}.{field}": Value(source, field) for field in fields if field in offered}


def _output(names: _Names, name: str, reference: str) -> Value:
    where = names.graph.where(f"outputs.{name}")
    # A program may ask for an output of a group's use, which has another name in the flat graph.
    return names.resolve(str(flat_reference(names.graph, reference, "", where)), where)


def _check_recalls(tasks: Mapping[str, Task]) -> None:
    """Refuse a previous value of a node that does not change from item to item.

    In a graph without a stream there is no previous item, as for a stream's first item.
    """
    has_items = any(task.stream for task in tasks.values())
    for task in tasks.values():
        if not has_items:
            task.recalls = {}
        for name, value in task.recalls.items():
            where = task.entry.where(f"in.{name}")
            if not task.stream:
                raise GraphError(f"{where}: '{task.id}' runs once; there is no previous item")
            if not tasks[value.node].stream:
                raise GraphError(
                    f"{where}: '{value}' is the same for all items; leave out 'previous.'"
                )


def _refuse_cycles(graph: Graph, tasks: Mapping[str, Task], before: Before) -> None:
    """Name the place that closes a cycle: in the graph's own file if it has one, as a patch may."""
    if cycle := find_cycle(before):
        places = [graph.nodes[cycle[0]].where("in")] + [
            tasks[reader].entry.where(f"in.{name}")
            for reader in cycle
            for name, value in tasks[reader].reads.items()
            if value.node in cycle
        ]
        own = graph.where("").partition(":")[0]
        where = min(places, key=lambda place: not place.startswith(own))
        raise GraphError(f"{where}: the graph has a cycle: {' -> '.join(cycle)}")


def settings_of(
    entry: Entry, graph: Graph, node: Node, arguments: Mapping[str, Any]
) -> dict[str, Any]:
    """A node's parameters, with the value of each `$name`.  Raises the errors of `bind`."""
    settings = dict(entry.settings)
    places: dict[str, str] = {}
    for name, param in entry.params.items():
        settings[name] = _param(param, graph, arguments, entry.where(f"with.{name}"))
        if name in node.parameters and param in arguments:
            places[name] = f"{graph.name}: {param}"
        elif name in node.parameters and graph.params[param].kind == "path":
            # A default that does not fit is not the fault of the graph file.
            places[name] = f"{graph.name}: give {param}=, since its default is not usable"

    def where(name: str) -> str:
        return places.get(name) or entry.where(f"with.{name}")

    return check_settings(node, settings, where)


def _param(name: str, graph: Graph, arguments: Mapping[str, Any], where: str) -> Any:
    if name not in graph.params:
        raise GraphError(
            f"{where}: the graph has no param '{name}'{did_you_mean(name, graph.params)}"
        )
    param = graph.params[name]
    if name in arguments:
        return arguments[name]
    if param.required:
        about = f" ({param.help})" if param.help else ""
        raise InputError(f"{graph.name} needs {name}=...{about}")
    return param.default


def _mark_streams(ordered: Sequence[Task], before: Before) -> None:
    """Mark the tasks of the stream: those that yield items or are handed in, and their readers."""
    of_stream: set[str] = set()
    for task in ordered:
        task.stream = task.node.stream or task.stand_in or not of_stream.isdisjoint(before[task.id])
        if task.stream:
            of_stream.add(task.id)
    streams = [task for task in ordered if task.node.stream]
    if len(streams) > 1:
        first, second = streams[:2]
        raise GraphError(
            f"{second.entry.where('op')}: a graph has one stream, and '{first.id}' begins it"
        )
