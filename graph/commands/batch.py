"""``tactograph batch``: many captures into one store."""

from __future__ import annotations

import csv
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tactograph.graph.commands import RunOptions, graph_command, run_options, say
from tactograph.graph.commands.progress_line import ProgressLine
from tactograph.graph.errors import a_few, printable

if TYPE_CHECKING:
    from tactograph.graph.batch.batch import Workers
    from tactograph.graph.batch.entry import Entry
    from tactograph.graph.batch.job import Job
    from tactograph.graph.batch.store import Store
    from tactograph.graph.batch.worker import Tally
    from tactograph.graph.files.flat_graph import Graph

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
    from tactograph.graph.batch.captures import find_captures
    from tactograph.graph.disk.text_names import at_home

    # A shell does not expand ~ within quotes, as of patterns, or after --out=.
    out = at_home(out)
    captures, below, passed_over = find_captures([at_home(pattern) for pattern in over])
    with ExitStack() as closing:
        # Slow imports follow here, while the processes import and open.
        _start_importing(workers, len(captures))
        read = options.read(graph)
        from tactograph.graph.batch.job import make_job, store_place
        from tactograph.graph.files.typed_values import read_words

        job = make_job(
            read,
            read_words(read, values),
            out=out,
            maps=maps.split(",") if maps else None,
            backend=options.backend,
            device=options.device,
            strict=options.strict,
            below=below,
        )
        if job.folders is not None:
            from tactograph.graph.run.open_pipeline import refuse_to_write_over

            read_places = filter(None, (below, *captures))
            refuse_to_write_over(f"--out {out}", out, {f"--over {p}": p for p in read_places})
        place = store_place(out, job)
        who = _here(workers, read, job, len(captures), place, closing)
        from tactograph.graph.batch.batch import (
            lies_in,
            open_batch,
            open_chunks,
            reopen_damaged,
            run_batch,
        )
        from tactograph.graph.batch.store_lock import alone_in
        from tactograph.graph.cache.result_origin import find_origin

        origin = find_origin(read, backend=options.backend, device=options.device)
        files = [file for file in passed_over if not lies_in(file, place, job.folders)]
        if files:
            say(f"passed over, as it is no folder: {a_few(files, 3)}", err=True)
        closing.enter_context(alone_in(place))
        store = open_batch(out, job, origin, captures, who, chunk)
        damaged = reopen_damaged(store)
        if damaged:
            plural = "s" if damaged > 1 else ""
            say(f"{damaged} finished capture{plural} damaged: done again", err=True)
        chunks = open_chunks(place, store, retry_failed=retry_failed)
        to_do = sum(len(each.captures) for each in chunks)
        say(f"{_before(store, retry_failed=retry_failed)}; {who.name}")
        _show(run_batch(store, chunks, who), to_do)
    failed = _conclude(store, out if job.folders is None else f"{job.folders}/captures")
    if failed:
        raise SystemExit(1)


def _before(store: Store, *, retry_failed: bool) -> str:
    """The numbers of captures, and of those that were finished, or failed, before."""
    from tactograph.graph.batch.entry import DONE, FAILED

    statuses = store.statuses
    finished, failed = (int((statuses == status).sum()) for status in (DONE, FAILED))
    line = f"{len(store)} captures, {finished} of them finished before"
    if not failed:
        return line
    return f"{line}, {failed} failed ({'' if retry_failed else 'not '}done again)"


def _start_importing(number: int | None, captures: int) -> None:
    """Start the imports of processes, if there are to be several."""
    from tactograph.graph.batch.fork_server import start_importing
    from tactograph.graph.batch.worker_count import at_most

    if (number or at_most(captures)) > 1:
        start_importing()


def _here(
    number: int | None, graph: Graph, job: Job, captures: int, place: str, closing: ExitStack
) -> Workers:
    """This process, or several that open the job's pipeline while this one goes on.

    If a store exists, nothing may be left to do, so they open it only when asked.
    """
    from tactograph.graph.batch.fork_server import hand_over, start_processes
    from tactograph.graph.batch.open_job import open_ahead
    from tactograph.graph.batch.worker_count import worker_count

    backends = [job.backend] if job.backend else graph.backends
    number = number or worker_count(backends, job.device, captures)
    if number == 1:
        from tactograph.graph.batch.worker import Serial

        return Serial()
    from tactograph.graph.batch.processes import Processes

    idle = start_processes(number)
    workers = closing.enter_context(Processes(number, idle=idle))
    for _ in range(0 if Path(place).exists() else number):
        hand_over(idle, open_ahead, job, graph)
    return workers


def _show(tallies: Iterator[Tally], total: int) -> None:
    """Show what is done, how fast, and the time left; and fallbacks."""
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


def _conclude(store: Store, out: str) -> int:
    """Write the table beside the store, print a summary, and return the number of failures."""
    from tactograph.graph.batch.entry import DONE, FAILED
    from tactograph.graph.show.warning_lines import first_lines, warning_lines

    captures, entries = store.captures, store.read_all()
    failures = [(c, e) for c, e in zip(captures, entries, strict=True) if e.status == FAILED]
    # Most reasons begin with the place.
    reasons = [e.reason if c in e.reason else f"{c}: {e.reason}" for c, e in failures]
    warnings = ((c, e.warnings) for c, e in zip(captures, entries, strict=True))
    failed = first_lines([f"failed: {reason}" for reason in reasons], MAX_FAILURES, "failed")
    for line in (*failed, *warning_lines(warnings)):
        say(line, err=True)
    table = Path(out.rstrip("/").removesuffix(".zarr") + ".csv")
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
    from tactograph.graph.batch.entry import STATUS_NAMES
    from tactograph.graph.disk.atomic_files import atomic_file

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
