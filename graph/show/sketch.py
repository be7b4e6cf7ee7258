"""A graph to draw: boxes and edges; uses of groups are drawn open, or folded to one box."""

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field

Edge = tuple[str, str, str]
"""A box, a box that reads it, and the ports of the values, separated by commas."""


@dataclass(frozen=True)
class Box:
    """A node, or a folded use."""

    name: str
    label: str
    backend: str


@dataclass(frozen=True)
class Sketch:
    """Boxes, the edges between them, and edges to the next item; `groups` has each use's group."""

    title: str
    boxes: list[Box]
    edges: list[Edge]
    recalls: list[Edge]
    groups: Mapping[str, str] = field(default_factory=dict)


def fold(sketch: Sketch, opened: Iterable[str] = ()) -> Sketch:
    """Draw each use as one box, unless it is opened, or reads values that follow from its own."""
    import networkx as nx  # slow, and a run draws nothing

    opened = {*opened}
    place = {box.name: index for index, box in enumerate(sketch.boxes)}
    while True:
        box_of = {box.name: box_around(box.name, sketch.groups, opened) for box in sketch.boxes}
        edges = _renamed(sketch.edges, box_of)
        members: dict[str, list[Box]] = {}
        for box in sketch.boxes:
            members.setdefault(box_of[box.name], []).append(box)
        graph = nx.DiGraph((a, b) for a, b, _ in edges)
        graph.add_nodes_from(members)
        if nx.is_directed_acyclic_graph(graph):
            break
        loop = [a for a, _ in nx.find_cycle(graph)]
        # Opened, a use is at least one box more, so this ends.
        opened |= {box for box in loop if box in sketch.groups}
    in_order = nx.lexicographical_topological_sort(graph, lambda n: place[members[n][0].name])
    boxes = [_folded(sketch, name, members[name]) for name in in_order]
    recalls = _renamed(sketch.recalls, box_of, loops=True)
    return Sketch(sketch.title, boxes, edges, recalls, sketch.groups)


def box_around(name: str, uses: Container[str], opened: Container[str] = ()) -> str:
    """The outermost use around a node that is not opened; the node itself if all are."""
    parts = name.split(".")
    paths = (".".join(parts[:at]) for at in range(1, len(parts)))
    return next((path for path in paths if path in uses and path not in opened), name)


def _folded(sketch: Sketch, name: str, members: list[Box]) -> Box:
    if members[0].name == name:
        return members[0]
    backend = next((b.backend for b in members if b.backend != "numpy"), "numpy")
    return Box(name, f"{sketch.groups[name]}: {len(members)} nodes", backend)


def _renamed(joined: list[Edge], box_of: Mapping[str, str], *, loops: bool = False) -> list[Edge]:
    """The edges between boxes, one for all values from one box to another."""
    ports: dict[tuple[str, str], dict[str, None]] = {}
    for a, b, port in joined:
        if loops or box_of[a] != box_of[b]:
            ports.setdefault((box_of[a], box_of[b]), {})[port] = None
    return [(a, b, ", ".join(names)) for (a, b), names in ports.items()]
