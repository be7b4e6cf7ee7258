"""``tactograph graphs``: the graphs that ship."""

from __future__ import annotations

import click

from tactograph.graph.commands import say


@click.command("graphs", short_help="List the graphs that ship.")
def command() -> None:
    """List the graphs that ship with their titles; 'tactograph check GRAPH' lists the params."""
    from tactograph.graph.files.read_graph import read_graph, shipped_names

    names = shipped_names()
    width = max(map(len, names))
    for name in names:
        say(f"{name:<{width}}  {read_graph(name).title}")
