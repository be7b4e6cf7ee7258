"""What a picture of a plan shows: every step, or its nodes with the uses of groups folded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter

from tactograph.graph.plan.plan import Plan, Step

Edge = tuple[str, str, str]
"""From a box, to a box, and the ports of the values, separated by commas."""


@dataclass(frozen=True)
class Box:
    """A step, or a folded use; `use` is the use of a group that it is drawn in."""

    name: str
    what: str
    kind: str
    backend: str
    use: str = ""


@dataclass(frozen=True)
class Sketch:
    """Boxes in an order in which edges lead onwards, and the edges to the next item."""

    boxes: list[Box]
    edges: list[Edge]
    recalls: list[Edge]


def whole_sketch(plan: Plan) -> Sketch:
    """Every step, transfers too; steps of a use are drawn in it."""
    boxes = [Box(s.name, _what(plan, s), s.kind, s.backend, use_of(s)) for s in plan.steps]
    return Sketch(boxes, edges(plan), recalls(plan))


def folded_sketch(plan: Plan) -> Sketch:
    """The nodes; a use of a group is one box, unless it reads what was made of its own values."""
    uses = {name.partition(".")[0] for name in plan.graph.uses}
    box_of = {name: _outermost(name, uses) for name in plan.tasks}
    joined = edges(plan, transfers=False)
    while (loop := _loop(_renamed(joined, box_of))) is not None:
        # Unfolded, its nodes are at least one box more: this ends.
        inside = {box for box in loop if box in uses}
        box_of |= {name: name for name, box in box_of.items() if box in inside}
    members: dict[str, list[Step]] = {}
    for step in plan.steps:
        if step.name in box_of:
            members.setdefault(box_of[step.name], []).append(step)
    found = _renamed(joined, box_of)
    order = _order(members, found)
    boxes = [_folded(plan, name, members[name]) for name in order]
    return Sketch(boxes, found, _renamed(recalls(plan), box_of, loops=True))


def _folded(plan: Plan, name: str, steps: list[Step]) -> Box:
    if name in plan.tasks:
        return Box(name, _what(plan, steps[0]), steps[0].kind, steps[0].backend)
    backend = next((s.backend for s in steps if s.on_device), steps[0].backend)
    return Box(name, f"{plan.graph.uses[name].group}: {len(steps)} nodes", "use", backend)


def _outermost(name: str, uses: set[str]) -> str:
    first = name.partition(".")[0]
    return first if first in uses else name


def _renamed(joined: list[Edge], box_of: Mapping[str, str], *, loops: bool = False) -> list[Edge]:
    """The edges between boxes, one for all values that go from one to another."""
    ports: dict[tuple[str, str], dict[str, None]] = {}
    for a, b, port in joined:
        if loops or box_of[a] != box_of[b]:
            ports.setdefault((box_of[a], box_of[b]), {})[port] = None
    return [(a, b, ", ".join(names)) for (a, b), names in ports.items()]


def _sorter(joined: list[Edge]) -> TopologicalSorter[str]:
    sorter: TopologicalSorter[str] = TopologicalSorter()
    for a, b, _ in joined:
        sorter.add(b, a)
    return sorter


def _loop(joined: list[Edge]) -> list[str] | None:
    try:
        _sorter(joined).prepare()
    except CycleError as error:
        loop: list[str] = error.args[1]
        return loop
    return None


def _order(members: Mapping[str, list[Step]], joined: list[Edge]) -> list[str]:
    sorter = _sorter(joined)
    for name in members:
        sorter.add(name)
    return list(sorter.static_order())


def edges(plan: Plan, *, transfers: bool = True) -> list[Edge]:
    """Every edge between steps as (from, to, port), with the transfers in between or without."""
    if not transfers:
        names = plan.tasks.items()
        return [
            (v.node, n, v.port) for n, task in names for v in dict.fromkeys(task.reads.values())
        ]
    moves = {s.reads[0]: s for s in plan.steps if s.kind in ("upload", "download")}
    on_device = {step.name: step.on_device for step in plan.steps}
    found: dict[Edge, None] = {}
    for step in plan.steps:
        for value in step.reads:
            maker = value.node
            moved = moves.get(value)
            if moved is not None and step is not moved and on_device[maker] != step.on_device:
                maker = moved.name
            found[maker, step.name, value.port] = None
    return list(found)


def recalls(plan: Plan) -> list[Edge]:
    """Every edge from an item to the next one as (from, to, port)."""
    return [
        (value.node, task.id, value.port)
        for task in plan.tasks.values()
        for value in task.recalls.values()
    ]


def use_of(step: Step) -> str:
    """The use of a group that a step is in: what stands before the last dot of its node."""
    node = step.name if step.kind in ("run", "fill") else step.reads[0].node
    return node.rpartition(".")[0]


def _what(plan: Plan, step: Step) -> str:
    task = plan.tasks.get(step.name)
    return task.node.name if task else step.kind
