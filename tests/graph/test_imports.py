"""The engine's modules import one another in one direction."""

from __future__ import annotations

import ast
from pathlib import Path

import networkx as nx
import pytest

ROOT = Path(__file__).parents[2]
GRAPH = ROOT / "graph"
PACKAGE = "tactograph.graph"


def modules() -> dict[str, Path]:
    return {
        ".".join((PACKAGE, *file.relative_to(GRAPH).with_suffix("").parts)): file
        for file in GRAPH.rglob("*.py")
        if file.name != "__init__.py"
    }


def imports() -> nx.DiGraph[str]:
    """Every import at the top of a module, those for type checkers too."""
    found = modules()
    graph: nx.DiGraph[str] = nx.DiGraph()
    for name, file in found.items():
        top = ast.parse(file.read_text()).body
        guarded = [each for node in top if isinstance(node, ast.If) for each in node.body]
        for node in (*top, *guarded):
            if isinstance(node, ast.ImportFrom) and node.module:
                named = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
                graph.add_edges_from((name, other) for other in named if other in found)
    return graph


def test_no_module_imports_itself_by_way_of_others() -> None:
    circles = [
        sorted(part) for part in nx.strongly_connected_components(imports()) if len(part) > 1
    ]
    assert circles == []


@pytest.mark.parametrize("folder", ["graph", "nodes"])
def test_a_long_file_says_why(folder: str) -> None:
    for file in (ROOT / folder).rglob("*.py"):
        text = file.read_text()
        if len(text.splitlines()) > 400:
            assert "Long because" in (ast.get_docstring(ast.parse(text)) or ""), file
