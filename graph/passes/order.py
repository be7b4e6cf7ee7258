"""Pass 6: put the steps in order, and say when a value on the device is last read."""

from __future__ import annotations

from dataclasses import replace

import networkx as nx

from tactograph.graph.plan import Draft, Step, Value


def order(dag: nx.DiGraph[str], draft: Draft) -> list[Step]:
    """Sort the steps: what runs once, then sources, so that sizes clash before work is done.

    What the device does is enqueued before the host starts on something itself, so that both
    work; and first what the host will need soonest, that is what has most transfers still
    ahead of it.  Writers come last within what the edges allow, so that nothing is written if
    a later computation fails.
    """
    file_order = {name: index for index, name in enumerate(draft.graph.nodes)}
    ahead = _transfers_ahead(dag)

    def rank(name: str) -> tuple[bool, int, bool, int, int, str]:
        step: Step = dag.nodes[name]["step"]
        task = draft.tasks.get(name)
        group = 1
        if task is not None and task.node.source:
            group = 0
        elif task is not None and task.node.sink:
            group = 2
        place = file_order.get(name, -1)  # transfers do not keep a kernel waiting
        return step.stream, group, step.backend == "numpy", -ahead[name], place, name

    names = list(nx.lexicographical_topological_sort(dag, key=rank))
    return _with_releases([dag.nodes[name]["step"] for name in names], draft)


def _transfers_ahead(dag: nx.DiGraph[str]) -> dict[str, int]:
    """For each step the most transfers on any way from it to the end, its own included."""
    ahead: dict[str, int] = {}
    for name in reversed(list(nx.topological_sort(dag))):
        own = dag.nodes[name]["step"].kind in ("upload", "download")
        ahead[name] = own + max((ahead[after] for after in dag.successors(name)), default=0)
    return ahead


def _with_releases(steps: list[Step], draft: Draft) -> list[Step]:
    """Mark, per item, the last step that reads each value on the device.

    What the next item recalls stays.
    """
    last: dict[Value, int] = {}
    for index, step in enumerate(steps):
        if not step.stream:
            continue
        if step.backend == "opencl":
            for value in (*step.reads, *step.writes):
                last[value] = index
    made = {v for s in steps if s.stream for v in s.writes}
    made -= {v for task in draft.tasks.values() for v in task.recalls.values()}
    return [
        replace(step, release=tuple(v for v, at in last.items() if at == index and v in made))
        for index, step in enumerate(steps)
    ]
