"""``tactograph batch``: many captures into one store."""

from os.path import expanduser

import click

from tactograph.sdk import RunOptions, graph_command, need


@graph_command("batch", short_help="Run a graph over many captures, into one store.")
@click.option(
    "--over", multiple=True, required=True, metavar="PATTERN",
    help="Captures, such as 'recordings/**/capture_*' (quoted), or a folder of them.",
)  # fmt: skip
@click.option(
    "--out", required=True, metavar="PLACE",
    help="NAME.zarr for one store; else a folder of result folders.",
)  # fmt: skip
@click.option("--maps", metavar="A,B", help="Outputs to store.  [default: all H x W maps]")
@click.option(
    "--workers", type=click.IntRange(1),
    help="Processes on this machine.  [default: one a core, if each has enough to do]",
)  # fmt: skip
@click.option("--retry-failed", is_flag=True, help="Do those again that failed before.")
def command(
    graph: str,
    values: tuple[str, ...],
    over: tuple[str, ...],
    out: str,
    maps: str | None,
    workers: int | None,
    retry_failed: bool,
    options: RunOptions,
) -> None:
    """Run GRAPH over every capture that a pattern matches.

    A folder of results has the layout of the captures below the folder in which the patterns
    begin.

    The same command continues a batch that was stopped.  A capture that fails is recorded with
    its reason; the exit code is then 1.
    """
    need("batch", "a batch", "zarr", "numcodecs")
    from tactograph.rings.batch.captures import find_captures
    from tactograph.rings.batch.fork_server import at_most, start_importing

    # A shell does not expand ~ within quotes, as of patterns, or after --out=.
    out, *patterns = map(expanduser, (out, *over))
    captures = find_captures(patterns)
    if (workers or at_most(len(captures.captures))) > 1:
        start_importing()
    # Slow imports follow here, while the processes import and open.
    read = options.read(graph)
    from tactograph.rings.batch.job import make_job

    arguments, map_names = read.read_words(values), maps.split(",") if maps else None
    job = make_job(read, arguments, options, out=out, maps=map_names, below=captures.below)
    from tactograph.rings.batch.run_batch import run_batch

    if run_batch(job, captures, workers, retry_failed=retry_failed):
        raise SystemExit(1)
