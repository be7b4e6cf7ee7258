"""``tactograph schema``: the JSON schema of graph files."""

import json

import click

from tactograph.graph.commands import say


@click.command("schema", short_help="Print the JSON schema of graph files.")
def command() -> None:
    """Print the schema; editors use it for completion and red lines."""
    from tactograph.graph.files.schema import make_schema

    say(json.dumps(make_schema(), indent=1))
