"""Pass 5: bring every array to where it is read: one upload per value, shared."""

from __future__ import annotations

from collections.abc import Mapping

from tactograph.graph.plan.draft import Draft, Value
from tactograph.graph.plan.plan import Placement, Step


def insert(
    draft: Draft, placements: Mapping[str, Placement]
) -> tuple[dict[str, Step], dict[str, list[str]]]:
    """Return the steps by name, transfers among them, and what each waits for."""
    plan = _Steps(draft, placements)
    for task in draft.tasks.values():
        for name, value in task.reads.items():
            moves = task.node.inputs[name].kind == "array" and not task.filled
            there = placements[task.id].on_device if moves else None
            plan.before[task.id].append(plan.origin(value, there))
        for name, value in task.recalls.items():
            if task.node.inputs[name].kind == "array" and not task.filled:
                # Brought over at the end of an item, for the reader at the next one.
                plan.origin(value, placements[task.id].on_device)
    for value in draft.outputs.values():
        if draft.tasks[value.node].node.outputs[value.port].kind == "array":
            plan.origin(value, False)
    return plan.steps, plan.before


class _Steps:
    """The steps so far, and for each those that it waits for."""

    def __init__(self, draft: Draft, placements: Mapping[str, Placement]) -> None:
        self._draft, self._placements = draft, placements
        self.steps: dict[str, Step] = {}
        self.before: dict[str, list[str]] = {}
        for task in draft.tasks.values():
            placement = placements[task.id]
            self._add(
                Step(
                    kind="fill" if task.filled else "run",
                    name=task.id,
                    backend=placement.backend,
                    # A constant depends on its inputs' sizes, not on the inputs.
                    reads=() if task.filled else tuple(dict.fromkeys(task.reads.values())),
                    writes=tuple(Value(task.id, port) for port in task.node.outputs),
                    stream=task.stream,
                    why=placement.why,
                )
            )

    def origin(self, value: Value, on_device: bool | None) -> str:
        """The step behind which a value can be read, a transfer if it is made elsewhere.

        `on_device` says where the value is read; None where it is not moved.
        """
        if on_device is None or on_device == self._placements[value.node].on_device:
            return value.node
        name = f"{'upload' if on_device else 'download'} {value}"
        if name not in self.steps:
            transfer = Step(
                kind="upload" if on_device else "download",
                name=name,
                backend=next(p.backend for p in self._placements.values() if p.on_device),
                reads=(value,),
                writes=(value,),
                stream=self._draft.tasks[value.node].stream,
                why="shared by all readers",
            )
            self._add(transfer, value.node)
        return name

    def _add(self, step: Step, *before: str) -> None:
        self.steps[step.name] = step
        self.before[step.name] = list(before)
