"""Plans: placements, steps, and the plan itself."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

from tactograph.graph.declare.engine_arguments import Wanted
from tactograph.graph.declare.ports import PortType
from tactograph.graph.errors import InputError, did_you_mean
from tactograph.graph.files.flat_graph import split_reference
from tactograph.graph.files.groups import flat_reference
from tactograph.graph.plan.draft import Draft, Value
from tactograph.graph.plan.sizes import SizeClasses

MAX_NAMED_NODES = 6
"""The most nodes that a line about one fallback names; it counts more."""


@dataclass(frozen=True)
class Placement:
    """The back end of a node, and why; `fallback` if a preferred back end could not run it.

    `calls` are its arguments that call other nodes on the device.
    """

    backend: str
    why: str
    fallback: bool = False
    calls: tuple[str, ...] = ()

    @property
    def on_device(self) -> bool:
        return self.backend != "numpy"


@dataclass(frozen=True)
class Step:
    """A step of the plan: a node, a constant, or a transfer.

    It rests for an item if one of its `conditions` does not hold: the node's own, or those that all
    readers of a transferred value share.
    """

    kind: Literal["run", "fill", "upload", "download"]
    name: str
    backend: str
    reads: tuple[Value, ...]
    writes: tuple[Value, ...]
    stream: bool
    why: str = ""
    conditions: tuple[Value, ...] = ()
    release: tuple[Value, ...] = ()

    @property
    def on_device(self) -> bool:
        return self.backend != "numpy"

    @property
    def is_transfer(self) -> bool:
        return self.kind in ("upload", "download")


@dataclass(kw_only=True)
class Plan(Draft):
    """A verified graph with the steps of its run, in order."""

    arguments: Mapping[str, Any]
    placements: dict[str, Placement]
    sizes: SizeClasses
    steps: list[Step]
    device: str | None
    inspected: set[Value] = field(default_factory=set)

    def inspect(self, value: Value) -> None:
        """From now on want a value from inside the graph, too."""
        self.inspected.add(value)
        names = self.wanted[value.node].names or ()
        self.wanted[value.node] = Wanted(frozenset({*names, value.port}))

    @cached_property
    def recalled(self) -> frozenset[Value]:
        """The values that one item keeps for the next."""
        return frozenset(v for task in self.tasks.values() for v in task.recalls.values())

    @cached_property
    def wanted(self) -> dict[str, Wanted]:
        """By node, the outputs that other nodes or the caller read, or that are inspected."""
        edges = [
            v for task in self.tasks.values() for v in (*task.edges.values(), *task.conditions)
        ]
        read: dict[str, set[str]] = {name: set() for name in self.tasks}
        for value in (*edges, *self.outputs.values()):
            maker: str | None = value.node
            while maker is not None:
                read[maker].add(value.port)
                maker = self.tasks[maker].instead
        return {name: Wanted(frozenset(ports)) for name, ports in read.items()}

    def value(self, reference: str) -> Value:
        """The value of ``node.port``, or of ``node`` if that has one output.

        Raises InputError if the plan has no such value.
        """
        where = f"{self.graph.name}: {reference}"
        flat = str(flat_reference(self.graph, reference, "", where))
        name, port = split_reference(flat, self.graph.nodes)
        if name not in self.tasks:
            if name in self.passed:
                raise InputError(f"{where}: '{name}' is taken out; read {self.passed[name]}")
            hint = did_you_mean(name, self.tasks)
            raise InputError(f"{where}: no node '{name}' is run{hint}")
        return Value.of(name, port, self.tasks[name].node.outputs, where)

    def port(self, output: str) -> PortType:
        """The port behind one of the graph's outputs."""
        return self.port_of(self.outputs[output])

    @property
    def fallbacks(self) -> list[str]:
        """The nodes that fell back to another back end, one line for each reason."""
        fallen: dict[Placement, list[str]] = {}
        for node_id, placement in self.placements.items():
            if placement.fallback:
                fallen.setdefault(placement, []).append(node_id)
        everywhere = len({placement.backend for placement in self.placements.values()}) == 1
        lines = []
        for place, ids in fallen.items():
            on = f"on {place.backend}: {place.why}"
            if everywhere and len(ids) > 1 and len(fallen) == 1:
                lines.append(f"every node runs {on}")
            elif len(ids) <= MAX_NAMED_NODES:
                lines.append(f"{', '.join(ids)} {'run' if len(ids) > 1 else 'runs'} {on}")
            else:
                first = ", ".join(ids[:3])
                lines.append(
                    f"{len(ids)} nodes ({first}, …) run {on}; 'tactograph explain' lists them"
                )
        return lines
