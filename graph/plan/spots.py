"""Spots: where a value lies, on the host or on the device."""

from typing import Literal, NamedTuple

from tactograph.graph.plan.draft import Value
from tactograph.graph.plan.plan import Plan, Step

Side = Literal["host", "device"]


class Spot(NamedTuple):
    """A value and the side where it lies."""

    value: Value
    side: Side


def put_out(plan: Plan, value: Value) -> Spot:
    """The spot where the caller takes an output."""
    return Spot(value, "device" if value in plan.stays else "host")


def read_by(plan: Plan, step: Step) -> list[Spot]:
    """The spots of this item that a step reads."""
    conditions = [Spot(value, "host") for value in step.conditions]
    if step.is_transfer:
        return [*conditions, Spot(step.reads[0], "host" if step.kind == "upload" else "device")]
    if step.kind == "fill":
        return conditions
    task = plan.tasks[step.name]
    ports, inherited = task.node.inputs, task.inherited
    stand_in = [Spot(inherited[v], side) for v, side in written_by(step) if v in inherited]
    return [
        *conditions,
        *stand_in,
        *(
            Spot(value, _side(ports[name].kind, step.on_device))
            for name, value in task.reads.items()
            if not (step.on_device and ports[name].kind == "object")
        ),
    ]


def written_by(step: Step) -> list[Spot]:
    """The spots that a step writes."""
    on_device = step.kind == "upload" or (step.on_device and step.kind != "download")
    return [Spot(value, "device" if on_device else "host") for value in step.writes]


def recalled_by(plan: Plan) -> list[Spot]:
    """The spots of this item that the next one reads."""
    return [
        Spot(value, _side(task.node.inputs[name].kind, plan.placements[task.id].on_device))
        for task in plan.tasks.values()
        for name, value in task.recalls.items()
        if not task.filled
    ]


def _side(kind: str, on_device: bool) -> Side:
    return "device" if on_device and kind == "array" else "host"
