"""``tactograph certify``: what a sensor measures, and how surely, by the graph of that name."""

import click


@click.command(
    "certify",
    short_help="State what a sensor measures, and how surely.",
    context_settings={"ignore_unknown_options": True},
)
@click.argument("values", nargs=-1, metavar="[NAME=VALUE]...", type=click.UNPROCESSED)
@click.pass_context
def command(context: click.Context, values: tuple[str, ...]) -> None:
    """Write a page and a JSON file on a sensor, in the terms of ISO 25178-600.

    The same as 'tactograph run certify'; 'tactograph run certify --help' lists its params.
    """
    assert context.parent is not None
    assert isinstance(context.parent.command, click.Group)
    run = context.parent.command.get_command(context, "run")
    assert run is not None
    with run.make_context("run", ["certify", *values], parent=context.parent) as words:
        run.invoke(words)
