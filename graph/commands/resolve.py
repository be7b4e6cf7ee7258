"""``tactograph resolve``: the flat graph behind a variant."""

from __future__ import annotations

import sys

import click


@click.command("resolve", short_help="Print the flat graph behind a variant.")
@click.argument("graph")
@click.option("--set", "settings", multiple=True, metavar="NODE.PARAM=VALUE")
def command(graph: str, settings: tuple[str, ...]) -> None:
    """Print GRAPH with 'extends' and 'patch' worked in: a graph file by itself."""
    from ruamel.yaml import YAML

    from tactograph.graph.given import read_settings
    from tactograph.graph.read import read_graph
    from tactograph.graph.run import with_changes

    read = with_changes(read_graph(graph), read_settings(settings))
    click.echo(f"# {read.name}, hash {read.hash}")
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = None
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.width = 100
    yaml.dump(read.as_dict(), sys.stdout)
