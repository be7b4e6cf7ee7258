"""Pass 5: bring every array to its readers, with one transfer per value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

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
                conditions=task.conditions,
            ),
        )
    for task in draft.tasks.values():
        for name, value in task.reads.items():
            moves = task.node.inputs[name].kind == "array" and not task.filled
            there = placements[task.id].on_device if moves else None
            dag.add_edge(_bring(dag, draft, placements, value, there, task.conditions), task.id)
        for value in task.conditions:
            there = False if draft.port_of(value).kind == "array" else None
            dag.add_edge(_bring(dag, draft, placements, value, there), task.id)
        for name, value in task.recalls.items():
            if task.node.inputs[name].kind == "array" and not task.filled:
                # Moved at the end of an item, for the reader of the next one.
                _bring(dag, draft, placements, value, placements[task.id].on_device)
    for value in draft.outputs.values():
        if draft.port_of(value).kind == "array":
            _bring(dag, draft, placements, value, value in draft.stays)
    for name in [*dag]:
        moved: Step = dag.nodes[name]["step"]
        for value in moved.conditions if moved.is_transfer else ():
            origin = f"download {value}"
            dag.add_edge(origin if origin in dag else value.node, name)
    return dag


def _reads(task: Task) -> tuple[Value, ...]:
    return tuple(dict.fromkeys((*task.reads.values(), *task.conditions)))


def _bring(
    dag: nx.DiGraph[str],
    draft: Draft,
    placements: Mapping[str, Placement],
    value: Value,
    on_device: bool | None,
    conditions: tuple[Value, ...] = (),
) -> str:
    """Return the step behind which `value` can be read: its maker, or a transfer if they are apart.

    `on_device` says where it is read, None where it is not moved; `conditions` are those of its
    reader.
    """
    if on_device is None or on_device == placements[value.node].on_device:
        return value.node
    name = f"{'upload' if on_device else 'download'} {value}"
    if name in dag:
        step = dag.nodes[name]["step"]
        shared = tuple(each for each in step.conditions if each in conditions)
        dag.nodes[name]["step"] = replace(step, conditions=shared)
        return name
    stream = draft.tasks[value.node].stream
    step = Step(
        kind="upload" if on_device else "download",
        name=name,
        backend=next(each.backend for each in placements.values() if each.on_device),
        reads=(value,),
        writes=(value,),
        stream=stream,
        why="shared by all readers",
        # What is moved once knows no item.
        conditions=tuple(
            each for each in conditions if stream or not draft.tasks[each.node].stream
        ),
    )
    dag.add_node(name, step=step)
    dag.add_edge(value.node, name)
    return name
