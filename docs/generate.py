"""Pages made from the code when the site is built: the nodes and the shipped graphs."""

from pathlib import Path

import mkdocs_gen_files

from tactograph.graph.declare.find_node import find_node, shipped_nodes
from tactograph.graph.declare.node_page import node_page
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.files.read_graph import read_graph, shipped_titles
from tactograph.graph.plan.sketch import plan_svg
from tactograph.graph.run.open_pipeline import open_pipeline


def write_nodes() -> None:
    """``nodes.md``, and a page for each node."""
    rows = ["# Nodes", "", "| node | kernel | what it does |", "| --- | --- | --- |"]
    for name in shipped_nodes():
        node = find_node(name)
        kernel = "yes" if node.has_kernel else ""
        rows.append(f"| [{name}](nodes/{name}.md) | {kernel} | {node.about.summary} |")
        with mkdocs_gen_files.open(f"nodes/{name}.md", "w") as page:
            page.write(node_page(node))
    with mkdocs_gen_files.open("nodes.md", "w") as page:
        page.write("\n".join(rows) + "\n")


def write_pipelines() -> None:
    """``pipelines.md``: what ships by folder, with params and a drawing of each graph."""
    lines = ["# Shipped graphs", ""]
    *folders, (heading, overlays) = shipped_titles().items()
    for folder, titles in folders:
        lines += [f"## {folder}", ""]
        for name in titles:
            graph = read_graph(name)
            lines += [f"### {name}", "", f"{graph.title}.", "", *_params(graph), ""]
            plan = open_pipeline(graph, graph.placeholders, backend="numpy").plan
            lines += ["<div>", plan_svg(plan).rstrip(), "</div>", ""]
    lines += [f"## {heading}", "", *(f"- `{name}`: {title}" for name, title in overlays.items())]
    with mkdocs_gen_files.open("pipelines.md", "w") as page:
        page.write("\n".join(lines))


def _params(graph: Graph) -> list[str]:
    rows = ["| param | kind | default | |", "| --- | --- | --- | --- |"]
    for name, param in graph.params.items():
        given = "none" if param.default is None else f"`{param.default}`"
        default = "needed" if param.required else given
        rows.append(f"| `{name}` | {param.kind} | {default} | {param.help} |")
    return rows


def write_ring_pages() -> None:
    """The pages of the rings, as if they lay beside the others."""
    for file in Path("rings").glob("*/docs/*.md"):
        with mkdocs_gen_files.open(file.name, "w") as page:
            page.write(file.read_text(encoding="utf-8"))


write_nodes()
write_pipelines()
write_ring_pages()
