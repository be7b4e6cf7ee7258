"""What a plan is made of: placements, steps, and the plan itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from tactograph.graph.declare.wanted_outputs import Wanted
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.plan.draft import Task, Value
from tactograph.graph.plan.sizes import SizeClasses


@dataclass(frozen=True)
class Placement:
    """Where a node runs and why; `fallback` if a preferred back end could not run it."""

    backend: str
    why: str
    fallback: bool = False

    @property
    def on_device(self) -> bool:
        return self.backend != "numpy"


@dataclass(frozen=True)
class Step:
    """One step of the plan."""

    kind: Literal["run", "fill", "upload", "download"]
    name: str
    backend: str
    reads: tuple[Value, ...]
    writes: tuple[Value, ...]
    stream: bool
    why: str = ""
    release: tuple[Value, ...] = ()

    @property
    def on_device(self) -> bool:
        return self.backend != "numpy"


@dataclass
class Plan:
    """The steps in order, and why each runs where it does."""

    graph: Graph
    given: Mapping[str, Any]
    tasks: dict[str, Task]
    outputs: dict[str, Value]
    placements: dict[str, Placement]
    sizes: SizeClasses
    steps: list[Step]
    device: str | None
    passed: dict[str, Value]
    unused: list[str]

    def wanted(self, node: str) -> Wanted:
        """The outputs of a node that another node reads, or the caller."""
        edges = [value for task in self.tasks.values() for value in task.edges.values()]
        read = {v.port for v in (*edges, *self.outputs.values()) if v.node == node}
        return Wanted(frozenset(read))

    @property
    def fallbacks(self) -> list[str]:
        """The nodes that fell back to another back end, a line for each reason."""
        alike: dict[Placement, list[str]] = {}
        for node_id, placement in self.placements.items():
            if placement.fallback:
                alike.setdefault(placement, []).append(node_id)
        return [
            f"{', '.join(ids)} {'run' if len(ids) > 1 else 'runs'} on {place.backend}: {place.why}"
            for place, ids in alike.items()
        ]
