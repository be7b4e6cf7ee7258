"""``tactograph compare``: variants side by side."""

from __future__ import annotations

from pathlib import Path

import click


@click.command("compare", short_help="Run variants side by side, into one table.")
@click.argument("words", nargs=-1, required=True, metavar="GRAPH... [NAME=VALUE]...")
@click.option("--over", multiple=True, required=True, metavar="DIR", help="A capture folder.")
@click.option("--backends", metavar="LIST", help="Such as numpy,opencl; default: as preferred.")
@click.option("--device", metavar="TEXT", help="Part of the OpenCL device's name.")
@click.option(
    "--out", default="report", show_default=True,
    type=click.Path(file_okay=False, path_type=Path), help="Folder for results and tables.",
)  # fmt: skip
def command(
    words: tuple[str, ...],
    over: tuple[str, ...],
    backends: str | None,
    device: str | None,
    out: Path,
) -> None:
    """Run every GRAPH on every capture on every back end.

    NAME=VALUE goes to every variant.  Folders among the words, as a shell makes them from
    DIR/*, are further captures.  What was finished before is not run again.
    """
    from rich.progress import track

    from tactograph.graph.compare import make_jobs, print_table, run_job, write_tables
    from tactograph.graph.errors import InputError
    from tactograph.graph.given import read_words
    from tactograph.graph.model import BACKENDS
    from tactograph.graph.read import read_graph

    captures = [Path(w) for w in (*over, *words) if "=" not in w and Path(w).is_dir()]
    missing = [w for w in over if not Path(w).is_dir()]
    if missing:
        raise InputError(f"--over {missing[0]}: there is no such folder")
    names = [w for w in words if "=" not in w and not Path(w).is_dir()]
    if not names:
        raise InputError("compare needs at least one graph to run")
    wanted: list[str | None] = list(backends.split(",")) if backends else [None]
    for backend in wanted:
        if backend not in (*BACKENDS, None):
            raise InputError(f"--backends {backends}: there are numpy and opencl")
    graphs = [read_graph(name) for name in names]
    values = [w for w in words if "=" in w]
    given = {graph.name: read_words(graph, values) for graph in graphs}
    jobs = make_jobs(graphs, captures, wanted)
    rows = [
        run_job(job, given[job.graph.name], out, device)
        for job in track(jobs, description="comparing", transient=True)
    ]
    write_tables(rows, out)
    print_table(rows, click.echo)
    click.echo(f"tables: {out / 'table.csv'}, {out / 'table.json'}")
    if all(row.error for row in rows):
        raise InputError("every run failed; the reasons are above")
