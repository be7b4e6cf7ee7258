"""The sketch of a plan: its nodes and the edges between them."""

from collections.abc import Iterable, Mapping

from tactograph.graph.plan.plan import Plan
from tactograph.graph.show.draw_svg import to_svg
from tactograph.graph.show.sketch import Box, Sketch, fold


def plan_svg(
    plan: Plan, times: Mapping[str, float] | None = None, opened: Iterable[str] = ()
) -> str:
    """The plan as SVG, with `times` in ms where known; a group's use is a box unless `opened`."""
    return to_svg(fold(sketch_of(plan), opened), times)


def sketch_of(plan: Plan) -> Sketch:
    """The nodes of a plan, in the order in which they run."""
    tasks = [plan.tasks[step.name] for step in plan.steps if step.name in plan.tasks]
    return Sketch(
        title=plan.graph.name,
        boxes=[Box(t.id, t.node.name, plan.placements[t.id].backend) for t in tasks],
        edges=[
            (value.node, task.id, value.port)
            for task in tasks
            for value in dict.fromkeys([*task.reads.values(), *filter(None, [task.when])])
        ],
        recalls=[
            (value.node, task.id, value.port) for task in tasks for value in task.recalls.values()
        ],
        groups={name: use.group for name, use in plan.graph.uses.items()},
    )
