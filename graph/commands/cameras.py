"""``tactograph cameras``: the cameras that are plugged in, by the graph of that name."""

from __future__ import annotations

import click


@click.command("cameras", short_help="List the cameras that are plugged in.")
def command() -> None:
    """List cameras: device, name, serial number, formats, sizes and rates."""
    from tactograph.graph.files.read_graph import read_graph
    from tactograph.graph.run.open_pipeline import open_pipeline

    with open_pipeline(read_graph("cameras"), {}) as pipeline:
        for _ in pipeline.items():
            pass  # its sink prints
