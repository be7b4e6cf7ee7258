"""A batch from its captures to its table, as the command runs and prints it."""

import csv
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

from tactograph.rings.batch.batch import (
    Workers,
    lies_in,
    open_batch,
    open_chunks,
    reopen_damaged,
    table_of,
)
from tactograph.rings.batch.captures import Captures
from tactograph.rings.batch.entry import DONE, FAILED, STATUS_NAMES, Entry
from tactograph.rings.batch.fork_server import worker_count
from tactograph.rings.batch.job import Job
from tactograph.rings.batch.processes import Processes
from tactograph.rings.batch.store import Store
from tactograph.rings.batch.worker import Tally, Worker
from tactograph.sdk import RunOptions, atomic_files, one_line

MAX_NAMED = 10
"""Failed captures, and files passed over, that are printed; the table has all captures."""


def run_batch(job: Job, captures: Captures, number: int | None, *, retry_failed: bool) -> int:
    """Do what is still to do of a batch by `number` workers, and return how many captures failed.

    Raises what `open_batch` raises, or if the place is one that is read.
    """
    place = Path(job.place)
    # If a store exists, nothing may be left to do.
    is_new, out = not place.exists(), job.folders or job.place
    around = [captures.below] if job.folders and captures.below else []
    over = [*around, *(each for each in captures.captures if not lies_in(each, job))]
    with RunOptions.progress(wanted=False) as line, ExitStack() as closing:
        closing.enter_context(RunOptions.alone_in(place, out, over))
        number = number or worker_count(job.graph, job.options, len(captures.captures))
        workers: Workers = Worker(job)
        if number > 1:
            workers = closing.enter_context(Processes(job, number))
            if is_new:
                workers.open_ahead()
        origin = job.options.origin(job.graph, job.arguments)
        files = [file for file in captures.passed_over if not lies_in(file, job)]
        for file in files[:MAX_NAMED]:
            line.say(f"warning: {file}: passed over, as it is no folder", err=True)
        if (more := len(files) - MAX_NAMED) > 0:
            line.say(f"warning: {more} more files passed over", err=True)
        store = open_batch(job, origin, captures.captures, workers)
        if damaged := reopen_damaged(store):
            plural = "s" if damaged > 1 else ""
            line.say(f"{damaged} finished capture{plural} damaged: done again", err=True)
        chunks = open_chunks(store, retry_failed=retry_failed)
        line.say(f"{_before(store, retry_failed=retry_failed)}; {workers.name}")
        _show(workers.run(iter(chunks)), sum(map(len, chunks)))
        return _conclude(store, job)


def _before(store: Store, *, retry_failed: bool) -> str:
    """The numbers of captures, and of those that were finished, or failed, before."""
    finished, failed = (int((store.statuses == status).sum()) for status in (DONE, FAILED))
    line = f"{len(store)} captures, {finished} of them finished before"
    if not failed:
        return line
    return f"{line}, {failed} failed ({'' if retry_failed else 'not '}done again)"


def _show(tallies: Iterator[Tally], total: int) -> None:
    """Show what is done, how fast, and the time left; and fallbacks."""
    start = time.monotonic()
    done = failed = 0
    shown_lines: set[str] = set()
    with RunOptions.progress() as line:
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
    captures, entries, line = store.captures, store.read_all(), RunOptions.progress(wanted=False)
    failures = [(c, e) for c, e in zip(captures, entries, strict=True) if e.status == FAILED]
    for capture, entry in failures[:MAX_NAMED]:
        # Most reasons begin with the place.
        place = "" if capture in entry.reason else f"{capture}: "
        line.say(f"failed: {place}{entry.reason}", err=True)
    if (more := len(failures) - MAX_NAMED) > 0:
        line.say(f"failed: {more} more, see the table", err=True)
    line.warnings((c, e.warnings) for c, e in zip(captures, entries, strict=True))
    table = Path(table_of(job))
    write_table(table, captures, entries)
    line.say(f"table: {table}")
    finished = sum(entry.status == DONE for entry in entries)
    warned = sum(bool(entry.warnings) for entry in entries)
    warned_of = f", {warned} with warnings" if warned else ""
    line.say(f"{finished} done, {len(failures)} failed{warned_of}")
    return len(failures)


def write_table(file: Path, captures: Sequence[str], entries: Sequence[Entry]) -> None:
    """Write a line for each capture."""
    figures = sorted({name for entry in entries for name in entry.figures})
    headings = ["number", "capture", "status", "milliseconds", *figures, "warnings", "reason"]
    with (
        atomic_files(file.parent, target=file) as target,
        (target / file.name).open("w", newline="") as stream,
    ):
        writer = csv.writer(stream)
        writer.writerow(headings)
        for number, (capture, entry) in enumerate(zip(captures, entries, strict=True)):
            start = [number, capture, STATUS_NAMES[entry.status], f"{entry.milliseconds:.1f}"]
            row = [entry.figures.get(name, "") for name in figures]
            cells = [*start, *row, "; ".join(entry.warnings), entry.reason]
            writer.writerow(one_line(each) if isinstance(each, str) else each for each in cells)
