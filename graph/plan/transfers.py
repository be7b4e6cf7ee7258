"""Pass 5: bring every array to its readers, with one transfer per value."""

from collections.abc import Mapping
from dataclasses import replace

from tactograph.graph.declare.ports import RESTING_INPUT
from tactograph.graph.errors import GraphError
from tactograph.graph.plan.draft import Draft, Task, Value
from tactograph.graph.plan.plan import Placement, Step


def insert(
    draft: Draft, placements: Mapping[str, Placement]
) -> tuple[dict[str, Step], dict[str, set[str]]]:
    """Return the steps (tasks and the transfers between them), and what comes before each."""
    steps = {name: _step(task, placements[name]) for name, task in draft.tasks.items()}
    before: dict[str, set[str]] = {name: set() for name in steps}

    def bring(value: Value, on_device: bool | None, conditions: tuple[Value, ...] = ()) -> str:
        """Return the step behind which `value` can be read: its maker, or a transfer.

        `on_device` is the side where it is read, None if it is never moved; `conditions` are those
        of the reader.
        """
        if on_device is None or on_device == placements[value.node].on_device:
            return value.node
        name = f"{'upload' if on_device else 'download'} {value}"
        if name in steps:
            shared = tuple(each for each in steps[name].conditions if each in conditions)
            steps[name] = replace(steps[name], conditions=shared)
            return name
        stream = draft.tasks[value.node].stream
        steps[name] = Step(
            kind="upload" if on_device else "download",
            name=name,
            backend=next(each.backend for each in placements.values() if each.on_device),
            reads=(value,),
            writes=(value,),
            stream=stream,
            why="shared by all readers",
            # A transfer outside the stream must not depend on an item's condition.
            conditions=tuple(c for c in conditions if stream or not draft.tasks[c.node].stream),
        )
        before[name] = {value.node}
        return name

    for task in draft.tasks.values():
        if task.instead is not None:
            before[task.id].add(task.instead)
            if placements[task.id].on_device != placements[task.instead].on_device:
                where = task.entry.where(f"in.{RESTING_INPUT}")
                raise GraphError(f"{where}: '{task.id}' and '{task.instead}' run on two back ends")
        for name, value in task.reads.items():
            moves = task.node.inputs[name].kind == "array" and not task.filled
            side = placements[task.id].on_device if moves else None
            before[task.id].add(bring(value, side, task.conditions))
        for value in task.conditions:
            side = False if draft.port_of(value).kind == "array" else None
            before[task.id].add(bring(value, side))
        for name, value in task.recalls.items():
            if task.node.inputs[name].kind == "array" and not task.filled:
                # Moved at the end of an item, for the reader of the next one.
                bring(value, placements[task.id].on_device)
    for value in draft.outputs.values():
        if draft.port_of(value).kind == "array":
            bring(value, value in draft.stays)
    for name, moved in steps.items():
        for value in moved.conditions if moved.is_transfer else ():
            origin = f"download {value}"
            before[name].add(origin if origin in steps else value.node)
    return steps, before


def _step(task: Task, placement: Placement) -> Step:
    """The step that runs a task; a constant depends on its inputs' sizes, not on the inputs."""
    values = (*task.reads.values(), *task.conditions, *task.inherited.values())
    return Step(
        kind="fill" if task.filled else "run",
        name=task.id,
        backend=placement.backend,
        reads=() if task.filled else tuple(dict.fromkeys(values)),
        writes=tuple(Value(task.id, port) for port in task.node.outputs),
        stream=task.stream,
        why=placement.why,
        conditions=task.conditions,
    )
