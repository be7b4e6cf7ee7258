"""``tactograph devices``: every OpenCL device, and whether it works."""

import click

from tactograph.graph.commands import say
from tactograph.graph.errors import InputError


@click.command("devices", short_help="List OpenCL devices and say which work.")
@click.option("--require", is_flag=True, help="Fail if no device works (simulators aside).")
def command(require: bool) -> None:
    """Compile and run a small kernel on every device, and print the verdict."""
    from tactograph.graph.backends.devices import choose_device, find_devices

    devices = find_devices()
    for device in devices:
        say(f"{'ok ' if device.works else 'bad'}  {device.name} [{device.kind}]: {device.verdict}")
    chosen, reason = choose_device()
    if chosen is not None:
        say(f"in use by default: {chosen.name}")
        return
    if require:
        raise InputError(reason)
    say(f"graphs run on the host: {reason}")
