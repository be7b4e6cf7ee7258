"""Pass 6: put the steps in order, and mark the last reader of each value on the device."""

from collections.abc import Mapping
from dataclasses import replace

from tactograph.graph.plan.before import Before, in_order
from tactograph.graph.plan.draft import Draft, Value
from tactograph.graph.plan.plan import Step


def order(steps: Mapping[str, Step], before: Before, draft: Draft) -> list[Step]:
    """Sort the steps so that host and device work at the same time.

    Steps outside the stream come first, then sources, so that a clash of sizes is found before any
    work is done.  Steps that a device step waits for come before the host's last steps.  Among
    them, the first are those with the most downloads ahead, then those with the most host steps
    ahead, since the host needs them soonest; the device computes the rest meanwhile.  Of equal
    steps the device's come before the host's, and before steps whose sizes depend on the data.

    Sinks come as late as the edges allow, so that nothing is written if a later computation fails.
    """
    file_order = {name: index for index, name in enumerate(draft.graph.nodes)}
    ahead = _ways_ahead(steps, before)

    def rank(name: str) -> tuple[bool, int, bool, int, int, bool, int, int, str]:
        step = steps[name]
        node = draft.tasks[name].node if name in draft.tasks else None
        group = 1 if node is None else 0 if node.source else 2 if node.sink else 1
        downloads, of_host, many = ahead[name]
        place = file_order.get(name, len(file_order))
        waits = not step.on_device or (node is not None and node.finds_sizes)
        last = waits and not downloads
        return step.stream, group, last, -downloads, -of_host, waits, -many, place, name

    return _with_releases([steps[name] for name in in_order(before, rank)], draft)


def _ways_ahead(steps: Mapping[str, Step], before: Before) -> dict[str, tuple[int, int, int]]:
    """For each step, the longest way to the end: in downloads, in host steps, and in steps."""
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

    Values that the next item recalls, or that the caller takes on the device, are not released.
    """
    last: dict[Value, int] = {}
    for index, step in enumerate(steps):
        if step.stream and step.on_device:
            for value in (*step.reads, *step.writes):
                last[value] = index
    streamed = {v for s in steps if s.stream for v in s.writes}
    streamed -= draft.stays.union(*(task.recalls.values() for task in draft.tasks.values()))
    return [
        replace(step, release=tuple(v for v, at in last.items() if at == index and v in streamed))
        for index, step in enumerate(steps)
    ]
