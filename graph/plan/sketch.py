"""Sketches of plans: every step, or the nodes alone."""

from tactograph.graph.plan.plan import Plan, Step
from tactograph.graph.show.sketch import Box, Edge, Sketch, use_of


def sketch_of(plan: Plan, *, transfers: bool = False) -> Sketch:
    """The nodes of a plan, and the transfers between them if wanted."""
    steps = [step for step in plan.steps if transfers or step.name in plan.tasks]
    return Sketch(
        title=plan.graph.name,
        boxes=[_box(plan, step) for step in steps],
        edges=_edges_by_steps(plan) if transfers else _edges(plan),
        recalls=[
            (value.node, task.id, value.port)
            for task in plan.tasks.values()
            for value in task.recalls.values()
        ],
        groups={name: use.group for name, use in plan.graph.uses.items()},
    )


def _box(plan: Plan, step: Step) -> Box:
    task = plan.tasks.get(step.name)
    if task is None:
        return Box(step.name, step.kind, step.kind, step.backend, use_of(step.reads[0].node))
    return Box(step.name, task.node.name, step.kind, step.backend, use_of(step.name))


def _edges(plan: Plan) -> list[Edge]:
    """The edges between nodes."""
    return [
        (value.node, name, value.port)
        for name, task in plan.tasks.items()
        for value in dict.fromkeys([*task.reads.values(), *filter(None, [task.when])])
    ]


def _edges_by_steps(plan: Plan) -> list[Edge]:
    """The edges between steps, through the transfers of their values."""
    moves = {step.reads[0]: step for step in plan.steps if step.is_transfer}
    on_device = {step.name: step.on_device for step in plan.steps}
    edges: dict[Edge, None] = {}
    for step in plan.steps:
        for value in step.reads:
            maker = value.node
            move = moves.get(value)
            if move is not None and step is not move and on_device[maker] != step.on_device:
                maker = move.name
            edges[maker, step.name, value.port] = None
    return list(edges)
