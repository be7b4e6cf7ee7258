"""Nodes that repeat an earlier node, so that a device need not run them."""

from itertools import combinations

from tactograph.graph.plan.draft import Task
from tactograph.graph.plan.plan import Plan


def first_alike(plan: Plan) -> dict[str, str]:
    """For each node, the earlier node that it repeats: the same operation on the same inputs.

    Either may read further optional inputs; it then repeats the other node if those are absent.
    """
    first: dict[str, str] = {}
    tasks = [plan.tasks[step.name] for step in plan.steps if step.kind == "run" and step.on_device]
    for task, other in combinations(tasks, 2):
        same = task.node is other.node and task.stream == other.stream
        if same and task.recalls == other.recalls and _alike(task, other):
            first.setdefault(other.id, task.id)
    return first


def _alike(task: Task, other: Task) -> bool:
    """Whether two nodes read the same values, except optional ones that only one of them reads.

    An array that only the first node reads is not allowed: it may be released before the second.
    """
    inputs, ours, theirs = task.node.inputs, task.reads, other.reads
    return all(ours[name] == theirs[name] for name in ours.keys() & theirs.keys()) and all(
        inputs[name].optional and (name in theirs or inputs[name].kind == "number")
        for name in ours.keys() ^ theirs.keys()
    )
