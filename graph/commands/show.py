"""``tactograph show``: what is in a file, by the graph of that name."""

from __future__ import annotations

from pathlib import Path

import click


@click.command("show", short_help="Print and draw what is in a file.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for the pictures; without it none are drawn.",
)
def command(file: Path, out: Path | None) -> None:
    """Print all that FILE holds: a calibration or a lens, a recording, a batch's store, a result.

    A calibration says whether it is doubtful and why, from what settings it was made and when.
    """
    from tactograph.graph.command import run_command

    drawn = [] if out is None else [f"out={out}"]
    run_command(["run", "show", f"file={file}", *drawn, "--quiet"])
