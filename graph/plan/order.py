"""Pass 6: put the steps in order, and say when a value on the device is last read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from graphlib import TopologicalSorter

from tactograph.graph.plan.draft import Draft, Value
from tactograph.graph.plan.edges import Edges, in_order, turned
from tactograph.graph.plan.plan import Step


def order(steps: Mapping[str, Step], before: Edges, draft: Draft) -> list[Step]:
    """Sort the steps: those of no stream, then sources, so that sizes clash before work is done.

    What the device does is enqueued before the host starts on something itself, so that both
    work; and first what the host will need soonest, that is what has most transfers still
    ahead of it.  Writers come last within what the edges allow, so that nothing is written if
    a later computation fails.
    """
    file_order = {name: index for index, name in enumerate(draft.graph.nodes)}
    ahead = _ways_ahead(steps, before)

    def rank(name: str) -> tuple[bool, int, bool, int, int, int, str]:
        step = steps[name]
        task = draft.tasks.get(name)
        group = 1
        if task is not None and task.node.source:
            group = 0
        elif task is not None and task.node.sink:
            group = 2
        transfers, number = ahead[name]
        place = file_order.get(name, len(file_order))
        return step.stream, group, not step.on_device, -transfers, -number, place, name

    return _with_releases([steps[name] for name in in_order(before, rank)], draft)


def _ways_ahead(steps: Mapping[str, Step], before: Edges) -> dict[str, tuple[int, int]]:
    """For each step the most transfers, and then steps, on any way from it to the end."""
    ahead: dict[str, tuple[int, int]] = {}
    behind = turned(before)
    for name in TopologicalSorter(behind).static_order():
        transfers, number = max((ahead[after] for after in behind[name]), default=(0, 0))
        own = steps[name].kind in ("upload", "download")
        ahead[name] = transfers + own, number + 1
    return ahead


def _with_releases(steps: list[Step], draft: Draft) -> list[Step]:
    """Mark, per item, the last step that reads each value on the device.

    What the next item recalls stays.
    """
    last: dict[Value, int] = {}
    for index, step in enumerate(steps):
        if not step.stream:
            continue
        if step.on_device:
            for value in (*step.reads, *step.writes):
                last[value] = index
    made = {v for s in steps if s.stream for v in s.writes}
    made -= {v for task in draft.tasks.values() for v in task.recalls.values()}
    return [
        replace(step, release=tuple(v for v, at in last.items() if at == index and v in made))
        for index, step in enumerate(steps)
    ]
