"""``tactograph cameras``: the cameras that are plugged in, by the graph of that name."""

import click

from tactograph.sdk.unstable import run_shipped


@click.command("cameras", short_help="List the cameras that are plugged in.")
def command() -> None:
    """List cameras: device, name and serial number."""
    run_shipped("cameras", {})
