"""``tactograph nodes``: the nodes there are, or the page of one."""

from __future__ import annotations

import click


@click.command("nodes", short_help="List the nodes, or show one node's page.")
@click.argument("name", required=False)
def command(name: str | None) -> None:
    """List all nodes with their summaries, or print everything about the node NAME."""
    from tactograph.graph.describe import node_page
    from tactograph.graph.errors import TactographError
    from tactograph.graph.find import find_node, node_names

    if name is not None:
        click.echo(node_page(find_node(name)))
        return
    names = node_names()
    width = max(map(len, names))
    for each in names:
        try:
            found = find_node(each)
        except TactographError as error:
            click.echo(f"{each:<{width}}  --  {error}")
            continue
        kernel = "cl" if "opencl" in found.backends else "  "
        host = "nb" if "numba" in found.backends else "  "
        click.echo(f"{each:<{width}}  {kernel} {host}  {found.summary}")
