"""The engine's modules, and its rooms, import one another in one direction."""

from __future__ import annotations

import ast
from pathlib import Path

import networkx as nx

from tests.sources import tree

ROOT = Path(__file__).parents[2]
GRAPH = ROOT / "graph"
PACKAGE = "tactograph.graph"


def modules() -> dict[str, Path]:
    return {
        ".".join((PACKAGE, *file.relative_to(GRAPH).with_suffix("").parts)): file
        for file in GRAPH.rglob("*.py")
        if file.name != "__init__.py"
    }


def room_of(module: str) -> str | None:
    """The folder of the engine that a module lies in; None for a module in no folder."""
    room = module.removeprefix(f"{PACKAGE}.").partition(".")[0]
    return room if (GRAPH / room).is_dir() else None


def imports() -> nx.DiGraph[str]:
    """Every import between modules, those inside functions and for type checkers too."""
    graph: nx.DiGraph[str] = nx.DiGraph()
    for module, file in modules().items():
        for node in ast.walk(tree(file)):
            if isinstance(node, ast.ImportFrom) and node.module:
                names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            else:
                continue
            graph.add_edges_from((module, name) for name in names if name.startswith(PACKAGE))
    return graph


def circles(graph: nx.DiGraph[str]) -> list[list[str]]:
    parts = nx.strongly_connected_components(graph)
    return [sorted(part) for part in parts if len(part) > 1]


def test_no_module_imports_itself_through_others() -> None:
    assert circles(nx.subgraph(imports(), modules())) == []


def test_no_room_imports_itself_through_others() -> None:
    rooms: nx.DiGraph[str] = nx.DiGraph()
    for module, imported in imports().edges:
        one, other = room_of(module), room_of(imported)
        if one and other and one != other:
            rooms.add_edge(one, other)
    assert {*rooms} == {file.parent.name for file in GRAPH.glob("*/*.py")}
    assert circles(rooms) == []
