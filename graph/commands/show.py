"""``tactograph show``: print and draw the content of a file, by the graph of that name."""

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
    from tactograph.graph.files.read_graph import read_graph
    from tactograph.graph.run.open_pipeline import open_pipeline

    given = {"file": str(file), "out": None if out is None else str(out)}
    with open_pipeline(read_graph("show"), given) as pipeline:
        for _ in pipeline.items():
            pass  # its sink prints
