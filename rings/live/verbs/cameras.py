"""``tactograph cameras``: the cameras that are plugged in, by node `list_cameras`."""

import click


@click.command("cameras", short_help="List the cameras that are plugged in.")
def command() -> None:
    """List cameras: device, name, serial number, formats, sizes and rates."""
    from tactograph.sdk.nodes import list_cameras

    list_cameras()
