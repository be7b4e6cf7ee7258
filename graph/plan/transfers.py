"""Pass 5: bring every array to its readers, with one transfer per value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import networkx as nx

from tactograph.graph.plan.draft import Draft, Task, Value
from tactograph.graph.plan.plan import Placement, Step


def insert(draft: Draft, placements: Mapping[str, Placement]) -> nx.DiGraph[str]:
    """Return the graph of steps: the tasks, and the transfers between them.

    Each node of the result carries its `Step` as the attribute ``step``.
    """
    dag: nx.DiGraph[str] = nx.DiGraph()
    for task in draft.tasks.values():
        placement = placements[task.id]
        dag.add_node(
            task.id,
            step=Step(
                kind="fill" if task.filled else "run",
                name=task.id,
                backend=placement.backend,
                # A constant depends on its inputs' sizes, not on the inputs.
                reads=() if task.filled else _reads(task),
                writes=tuple(Value(task.id, port) for port in task.node.outputs),
                stream=task.stream,
                why=placement.why,
            ),
        )
    for task in draft.tasks.values():
        for name, value in task.reads.items():
            moves = task.node.inputs[name].kind == "array" and not task.filled
            there = placements[task.id].on_device if moves else None
            _connect(dag, draft, placements, value, there, task.id)
        for value in task.conditions:
            array = draft.port_of(value).kind == "array"
            _connect(dag, draft, placements, value, False if array else None, task.id)
        for name, value in task.recalls.items():
            if task.node.inputs[name].kind == "array" and not task.filled:
                # Moved at the end of an item, for the reader of the next one.
                _connect(dag, draft, placements, value, placements[task.id].on_device, None)
    for value in draft.outputs.values():
        if draft.port_of(value).kind == "array":
            _connect(dag, draft, placements, value, value in draft.stays, None)
    return dag


def _reads(task: Task) -> tuple[Value, ...]:
    return tuple(dict.fromkeys((*task.reads.values(), *task.conditions)))


def _connect(
    dag: nx.DiGraph[str],
    draft: Draft,
    placements: Mapping[str, Placement],
    value: Value,
    on_device: bool | None,
    reader: str | None,
) -> None:
    """Connect the maker of `value` to `reader`, through a transfer if they are apart.

    `on_device` says where the value is read; None where it is not moved.
    """
    origin = value.node
    if on_device is not None and on_device != placements[value.node].on_device:
        device = next(each.backend for each in placements.values() if each.on_device)
        origin = _transfer(dag, draft.tasks[value.node], value, on_device, device)
    if reader is not None:
        dag.add_edge(origin, reader)


def _transfer(dag: nx.DiGraph[str], maker: Task, value: Value, up: bool, device: str) -> str:
    kind: Literal["upload", "download"] = "upload" if up else "download"
    name = f"{kind} {value}"
    if name not in dag:
        step = Step(
            kind=kind,
            name=name,
            backend=device,
            reads=(value,),
            writes=(value,),
            stream=maker.stream,
            why="shared by all readers",
        )
        dag.add_node(name, step=step)
        dag.add_edge(value.node, name)
    return name
