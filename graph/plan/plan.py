"""What a plan is made of: values, tasks, placements, steps; what the passes hand on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from tactograph.graph.declare.node import Node
from tactograph.graph.declare.wanted_outputs import Wanted
from tactograph.graph.files.model import Entry, Graph

if TYPE_CHECKING:
    from tactograph.graph.plan.sizes import SizeClasses


class Value(NamedTuple):
    """What one output port of one node produces."""

    node: str
    port: str

    def __str__(self) -> str:
        return f"{self.node}.{self.port}"


@dataclass
class Task:
    """A node of the graph with its references and settings resolved.

    `reads` are values of the same item, `recalls` those of the item before.
    """

    id: str
    node: Node
    entry: Entry
    settings: dict[str, Any]
    reads: dict[str, Value]
    recalls: dict[str, Value] = field(default_factory=dict)
    stream: bool = False
    stand_in: bool = False

    @property
    def filled(self) -> bool:
        """Whether a constant stands in for the node."""
        return self.entry.neutral

    @property
    def edges(self) -> dict[str, Value]:
        """Every value that the node takes, of this item or the one before, by input."""
        return {**self.reads, **self.recalls}


@dataclass(frozen=True)
class Placement:
    """Where a node runs and why; `fallback` if it was wanted elsewhere."""

    backend: str
    why: str
    fallback: bool = False

    @property
    def on_device(self) -> bool:
        return self.backend == "opencl"


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
        return self.backend == "opencl"


@dataclass
class Draft:
    """What the passes hand on: the graph with all that is known of it so far."""

    graph: Graph
    tasks: dict[str, Task]
    outputs: dict[str, Value]
    passed: dict[str, Value] = field(default_factory=dict)
    unused: list[str] = field(default_factory=list)


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
        """What runs elsewhere than it was wanted, a line for each reason."""
        alike: dict[Placement, list[str]] = {}
        for node_id, placement in self.placements.items():
            if placement.fallback:
                alike.setdefault(placement, []).append(node_id)
        return [
            f"{', '.join(ids)} {'run' if len(ids) > 1 else 'runs'} on {place.backend}: {place.why}"
            for place, ids in alike.items()
        ]
