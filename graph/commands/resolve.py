"""``tactograph resolve``: the flat graph behind a variant."""

from __future__ import annotations

import click

from tactograph.graph.commands import graph_argument, say


@click.command("resolve", short_help="Print the flat graph behind a variant.")
@graph_argument
@click.option("--set", "settings", multiple=True, metavar="NODE.PARAM=VALUE")
def command(graph: str, settings: tuple[str, ...]) -> None:
    """Print GRAPH with 'extends' and 'patch' worked in: a graph file by itself."""
    from tactograph.graph.files.changes import with_changes
    from tactograph.graph.files.dump_graph import dump_graph
    from tactograph.graph.files.read_graph import read_graph
    from tactograph.graph.run.typed_values import read_settings

    read = with_changes(read_graph(graph), read_settings(settings))
    say(dump_graph(read), nl=False)
