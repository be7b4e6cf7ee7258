"""``tactograph resolve``: the flat graph behind a variant."""

import click

from tactograph.graph.commands import changed, graph_argument, say, set_option, with_option


@click.command("resolve", short_help="Print the flat graph behind a variant.")
@graph_argument
@with_option
@set_option
def command(graph: str, overlays: tuple[str, ...], settings: tuple[str, ...]) -> None:
    """Print GRAPH with 'extends' and 'patch' applied, as a self-contained graph file."""
    from tactograph.graph.files.dump_graph import dump_graph
    from tactograph.graph.files.read_graph import read_graph

    say(dump_graph(changed(read_graph(graph), overlays, settings)), nl=False)
