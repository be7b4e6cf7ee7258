"""Pass 6: put the steps in order, and mark the last reader of each value on the device."""

from dataclasses import replace
from graphlib import TopologicalSorter
from heapq import heappop, heappush

from tactograph.graph.plan.draft import Draft, Value
from tactograph.graph.plan.plan import Step
from tactograph.graph.plan.transfers import StepGraph


def order(dag: StepGraph, draft: Draft) -> list[Step]:
    """Sort the steps: those of no stream, then sources, so that sizes clash before work is done.

    The device's steps come before the host's own, and before steps whose sizes depend on the data,
    so that both sides work.  Among them, those with the most transfers ahead come first, since the
    host needs them soonest.  Sinks come last within the limits of the edges, so that nothing is
    written if a later computation fails.
    """
    file_order = {name: index for index, name in enumerate(draft.graph.nodes)}
    ahead = _ways_ahead(dag)

    def rank(name: str) -> tuple[bool, int, bool, int, int, int, str]:
        step = dag.steps[name]
        task = draft.tasks.get(name)
        group = 1
        if task is not None and task.node.source:
            group = 0
        elif task is not None and task.node.sink:
            group = 2
        transfers, steps = ahead[name]
        place = file_order.get(name, len(file_order))
        waits = task is not None and task.node.finds_sizes
        return step.stream, group, not step.on_device or waits, -transfers, -steps, place, name

    sorter, steps = TopologicalSorter(dag.waits), []
    ready: list[tuple[bool, int, bool, int, int, int, str]] = []
    sorter.prepare()
    while sorter.is_active():
        for name in sorter.get_ready():
            heappush(ready, rank(name))
        *_, name = heappop(ready)
        sorter.done(name)
        steps.append(dag.steps[name])
    return _with_releases(steps, draft)


def _ways_ahead(dag: StepGraph) -> dict[str, tuple[int, int]]:
    """The most transfers, and then steps, on any way from each step to the end."""
    ahead = dict.fromkeys(dag.steps, (0, 0))
    for name in reversed([*TopologicalSorter(dag.waits).static_order()]):
        transfers, steps = ahead[name]
        ahead[name] = transfers + dag.steps[name].is_transfer, steps + 1
        for before in dag.waits[name]:
            ahead[before] = max(ahead[before], ahead[name])
    return ahead


def _with_releases(steps: list[Step], draft: Draft) -> list[Step]:
    """Mark the last step of an item that reads each value on the device.

    Values that the next item recalls, or the caller takes there, stay.
    """
    last: dict[Value, int] = {}
    for index, step in enumerate(steps):
        if not step.stream:
            continue
        if step.on_device:
            for value in (*step.reads, *step.writes):
                last[value] = index
    made = {v for s in steps if s.stream for v in s.writes}
    made -= draft.stays.union(*(task.recalls.values() for task in draft.tasks.values()))
    return [
        replace(step, release=tuple(v for v, at in last.items() if at == index and v in made))
        for index, step in enumerate(steps)
    ]
