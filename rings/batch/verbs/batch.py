"""``tactograph batch``: many captures into one store."""

from __future__ import annotations

import csv
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tactograph.sdk import need
from tactograph.sdk.unstable import RunOptions, a_few, graph_command, printable, run_options, say

if TYPE_CHECKING:
    from tactograph.rings.batch.batch import Workers
    from tactograph.rings.batch.entry import Entry
    from tactograph.rings.batch.job import Job
    from tactograph.rings.batch.store import Store
    from tactograph.rings.batch.worker import Tally

MAX_FAILURES = 10
"""Failed captures that are printed; the table has all."""


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
    "--chunk", type=click.IntRange(1, 4096),
    help="Captures that are written together.  [default: 64 MiB of maps, at most 32 captures]",
)  # fmt: skip
@click.option(
    "--workers", type=click.IntRange(1),
    help="Processes on this machine.  [default: one a core, if each has enough to do]",
)  # fmt: skip
@click.option("--retry-failed", is_flag=True, help="Do those again that failed before.")
@run_options
def command(
    graph: str,
    values: tuple[str, ...],
    over: tuple[str, ...],
    out: str,
    maps: str | None,
    chunk: int | None,
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

    # A shell does not expand ~ within quotes, as of patterns, or after --out=.
    out, *patterns = map(os.path.expanduser, (out, *over))
    captures, below, passed_over = find_captures(patterns)
    with ExitStack() as closing:
        # Slow imports follow here, while the processes import and open.
        _start_importing(workers, len(captures))
        read = options.read(graph)
        from tactograph.rings.batch.job import make_job
        from tactograph.sdk.unstable import find_origin, read_words, refuse_to_write_over

        arguments, wanted = read_words(read, values), maps.split(",") if maps else None
        job = make_job(read, arguments, options, out=out, maps=wanted, below=below)
        if job.folders is not None:
            read_places = filter(None, (below, *captures))
            refuse_to_write_over(f"--out {out}", out, {f"--over {p}": p for p in read_places})
        who = _here(workers, job, len(captures), closing)
        from tactograph.rings.batch.batch import (
            lies_in,
            open_batch,
            open_chunks,
            reopen_damaged,
        )
        from tactograph.rings.batch.store import alone_in

        origin = find_origin(read, job.arguments, backend=options.backend, device=options.device)
        files = [file for file in passed_over if not lies_in(file, job)]
        if files:
            say(f"passed over, as it is no folder: {a_few(files, 3)}", err=True)
        closing.enter_context(alone_in(job.place))
        store = open_batch(job, origin, captures, who, chunk)
        damaged = reopen_damaged(store)
        if damaged:
            plural = "s" if damaged > 1 else ""
            say(f"{damaged} finished capture{plural} damaged: done again", err=True)
        chunks = open_chunks(store, retry_failed=retry_failed)
        to_do = sum(len(each.captures) for each in chunks)
        say(f"{_before(store, retry_failed=retry_failed)}; {who.name}")
        _show(who.run(iter(chunks)), to_do)
    if _conclude(store, job):
        raise SystemExit(1)


def _before(store: Store, *, retry_failed: bool) -> str:
    """The numbers of captures, and of those that were finished, or failed, before."""
    from tactograph.rings.batch.entry import DONE, FAILED

    statuses = store.statuses
    finished, failed = (int((statuses == status).sum()) for status in (DONE, FAILED))
    line = f"{len(store)} captures, {finished} of them finished before"
    if not failed:
        return line
    return f"{line}, {failed} failed ({'' if retry_failed else 'not '}done again)"


def _start_importing(number: int | None, captures: int) -> None:
    """Start the imports of processes, if there are to be several."""
    from tactograph.rings.batch.fork_server import at_most, start_importing

    if (number or at_most(captures)) > 1:
        start_importing()


def _here(number: int | None, job: Job, captures: int, closing: ExitStack) -> Workers:
    """This process, or several that open the job's pipeline while this one goes on.

    If a store exists, nothing may be left to do, so they open it only when asked.
    """
    from tactograph.rings.batch.fork_server import worker_count

    number = number or worker_count(job.graph, job.options, captures)
    if number == 1:
        from tactograph.rings.batch.worker import Worker

        return Worker(job)
    from tactograph.rings.batch.processes import Processes

    workers = closing.enter_context(Processes(job, number))
    if not Path(job.place).exists():
        workers.open_ahead()
    return workers


def _show(tallies: Iterator[Tally], total: int) -> None:
    """Show what is done, how fast, and the time left; and fallbacks."""
    from tactograph.sdk.unstable import ProgressLine

    start = time.monotonic()
    done = failed = 0
    shown_lines: set[str] = set()
    with ProgressLine() as line:
        line.at(f"0 of {total} captures", 0.0)
        for tally in tallies:
            for text in {*tally.fallbacks} - shown_lines:
                line.say(f"fallback: {text}", err=True)
            shown_lines.update(tally.fallbacks)
            done, failed = done + tally.done + tally.failed, failed + tally.failed
            rate = done / max(time.monotonic() - start, 1e-9)
            line.at(
                f"{done} of {total} captures, {failed} failed, {rate:.1f} captures/s", done / total
            )


def _conclude(store: Store, job: Job) -> int:
    """Write the table beside the store, print a summary, and return the number of failures."""
    from tactograph.rings.batch.batch import table_of
    from tactograph.rings.batch.entry import DONE, FAILED
    from tactograph.sdk.unstable import warning_lines

    captures, entries = store.captures, store.read_all()
    failures = [(c, e) for c, e in zip(captures, entries, strict=True) if e.status == FAILED]
    for capture, entry in failures[:MAX_FAILURES]:
        # Most reasons begin with the place.
        place = "" if capture in entry.reason else f"{capture}: "
        say(f"failed: {place}{entry.reason}", err=True)
    if (more := len(failures) - MAX_FAILURES) > 0:
        say(f"failed: {more} more, see the table", err=True)
    warnings = ((c, e.warnings) for c, e in zip(captures, entries, strict=True))
    for line in warning_lines(warnings):
        say(line, err=True)
    table = Path(table_of(job))
    _write_table(table, captures, entries)
    say(f"table: {table}")
    finished = sum(entry.status == DONE for entry in entries)
    warned = sum(bool(entry.warnings) for entry in entries)
    say(
        f"{finished} done, {len(failures)} failed" + (f", {warned} with warnings" if warned else "")
    )
    return len(failures)


def _write_table(file: Path, captures: Sequence[str], entries: Sequence[Entry]) -> None:
    """Write a line for each capture."""
    from tactograph.rings.batch.entry import STATUS_NAMES
    from tactograph.sdk import atomic_file

    figures = sorted({name for entry in entries for name in entry.figures})
    headings = ["number", "capture", "status", "milliseconds", *figures, "warnings", "reason"]
    with atomic_file(file) as target, target.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(headings)
        for number, (capture, entry) in enumerate(zip(captures, entries, strict=True)):
            start = [number, capture, STATUS_NAMES[entry.status], f"{entry.milliseconds:.1f}"]
            row = [entry.figures.get(name, "") for name in figures]
            cells = [*start, *row, "; ".join(entry.warnings), entry.reason]
            writer.writerow(printable(each) if isinstance(each, str) else each for each in cells)
