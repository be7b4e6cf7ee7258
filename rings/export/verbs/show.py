"""``tactograph show``: print and draw the content of a file, by node `show_file`."""

from pathlib import Path

import click


@click.command("show", short_help="Print and draw what is in a file.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--out", type=click.Path(file_okay=False, path_type=Path),
    help="Folder for the pictures; without it none are drawn.",
)  # fmt: skip
def command(file: Path, out: Path | None) -> None:
    """Print all that FILE holds: a calibration or a lens, a recording, a batch's store, a result.

    A calibration says whether it is doubtful and why, from what settings it was made and when.
    """
    from tactograph.sdk.nodes import show_file

    show_file(file=file, folder=out)
