"""The draft of a plan: its values and tasks, which the passes fill in."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Self

from tactograph.graph.declare.node import Node
from tactograph.graph.declare.ports import PortType
from tactograph.graph.errors import GraphError, did_you_mean
from tactograph.graph.files.flat_graph import Entry, Graph


class Value(NamedTuple):
    """The value of one output port of a node."""

    node: str
    port: str

    @classmethod
    def of(
        cls, node: str, port: str | None, outputs: Iterable[str], where: str, stands: str = ""
    ) -> Self:
        """Return the value of a port, or of a node's only port.

        Raises GraphError if the node has no such output; `stands` says where the node is.
        """
        names = [*outputs]
        port = names[0] if port is None and len(names) == 1 else port
        if port in names:
            return cls(node, port)
        if not names:
            why = "only writes; nothing can be read from it"
        elif port is None:
            why = f"has several outputs; name one of {', '.join(f'{node}.{o}' for o in names)}"
        else:
            hint = did_you_mean(port, names) or f"; it has {', '.join(names)}"
            why = f"has no output '{port}'{hint}"
        raise GraphError(f"{where}: node '{node}' {why}{stands}")

    def __str__(self) -> str:
        return f"{self.node}.{self.port}"


@dataclass
class Task:
    """A node of the graph with its references and settings resolved.

    `reads` are values of the same item, `recalls` values of the previous item.  The task runs for
    an item if all its `conditions` hold: its own `when`, and the conditions of the nodes whose
    values it needs.  Otherwise the values of the task `instead`, if any, take their place.
    """

    id: str
    node: Node
    entry: Entry
    settings: dict[str, Any]
    reads: dict[str, Value]
    recalls: dict[str, Value] = field(default_factory=dict)
    stream: bool = False
    stand_in: bool = False
    when: Value | None = None
    instead: str | None = None
    conditions: tuple[Value, ...] = ()

    @property
    def filled(self) -> bool:
        """Return whether a constant stands in for the node."""
        return self.entry.neutral

    @property
    def looks_outside(self) -> bool:
        """Return whether its values may change while its settings and inputs stay the same.

        It yields items, keeps a session, takes the run's provenance, or names a file.
        """
        node = self.node
        of_the_run = bool(node.session or node.provenance)
        names_a_file = any(isinstance(value, Path) for value in self.settings.values())
        looks_outside = node.source or self.stand_in or of_the_run or names_a_file
        return looks_outside and not self.filled

    @property
    def inherited(self) -> dict[Value, Value]:
        """For each value, the one of the task `instead` that replaces it if this task rests."""
        ports = self.node.outputs if self.instead is not None else ()
        return {Value(self.id, port): Value(str(self.instead), port) for port in ports}

    @property
    def edges(self) -> dict[str, Value]:
        """All values that the node takes, of this or the previous item, by input."""
        return {**self.reads, **self.recalls}


@dataclass
class Draft:
    """A graph with its names resolved: its tasks, its outputs, and the nodes that do not run.

    `passed` are nodes taken out, with the values that they pass on; `unused` nodes that no output
    or sink needs; `stays` outputs that the caller takes on the device.
    """

    graph: Graph
    tasks: dict[str, Task]
    outputs: dict[str, Value]
    passed: dict[str, Value] = field(default_factory=dict)
    unused: list[str] = field(default_factory=list)
    stays: set[Value] = field(default_factory=set)

    def port_of(self, value: Value) -> PortType:
        """The output port behind a value."""
        return self.tasks[value.node].node.outputs[value.port]
