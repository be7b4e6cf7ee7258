"""``tactograph cameras``: the cameras that are plugged in, by the graph of that name."""

import click

from tactograph.sdk import load


@click.command("cameras", short_help="List the cameras that are plugged in.")
def command() -> None:
    """List cameras: device, name, serial number, formats, sizes and rates."""
    with load("cameras") as pipeline:
        for _ in pipeline.items():
            pass
