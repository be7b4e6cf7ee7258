"""Pass 6: put the steps in order, and mark the last reader of each value on the device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from tactograph.graph.plan.before import Before, in_order
from tactograph.graph.plan.draft import Draft, Value
from tactograph.graph.plan.plan import Step


def order(steps: Mapping[str, Step], before: Before, draft: Draft) -> list[Step]:
    """Sort the steps: those of no stream, then sources, so that sizes clash before work is done.

    Steps that the device's wait for come before the host's last ones, those with the most
    downloads ahead first, then those with the most steps of the host, which needs them soonest: the
    device does the others meanwhile.  Of equal ones the device's come before the host's, and before
    steps whose sizes depend on the data, so that both sides work.
    Sinks come last within the limits of the edges, so that nothing is written if a later
    computation fails.
    """
    file_order = {name: index for index, name in enumerate(draft.graph.nodes)}
    ahead = _ways_ahead(steps, before)

    def rank(name: str) -> tuple[bool, int, bool, int, int, bool, int, int, str]:
        step = steps[name]
        task = draft.tasks.get(name)
        group = 1
        if task is not None and task.node.source:
            group = 0
        elif task is not None and task.node.sink:
            group = 2
        downloads, of_host, many = ahead[name]
        place = file_order.get(name, len(file_order))
        waits = not step.on_device or (task is not None and task.node.finds_sizes)
        last = waits and not downloads
        return step.stream, group, last, -downloads, -of_host, waits, -many, place, name

    return _with_releases([steps[name] for name in in_order(before, rank)], draft)


def _ways_ahead(steps: Mapping[str, Step], before: Before) -> dict[str, tuple[int, int, int]]:
    """The most downloads, then steps of the host behind it, then steps from each to the end."""
    ahead = dict.fromkeys(steps, (0, 0, 0))
    for name in reversed(in_order(before)):
        downloads, of_host, many = ahead[name]
        step = steps[name]
        ahead[name] = downloads + (step.kind == "download"), of_host, many + 1
        way = ahead[name][0], of_host + (not step.on_device), many + 1
        for each in before[name]:
            ahead[each] = max(ahead[each], way)
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
    streamed = {v for s in steps if s.stream for v in s.writes}
    streamed -= draft.stays.union(*(task.recalls.values() for task in draft.tasks.values()))
    return [
        replace(step, release=tuple(v for v, at in last.items() if at == index and v in streamed))
        for index, step in enumerate(steps)
    ]
