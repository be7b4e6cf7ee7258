"""A line on a terminal, from two seconds on: the present stage, and the time that is left.

Where standard error is a file or a pipe, a line every ten seconds says the same.

Of many captures or runs, the time left follows from the share that is done.  That of one graph is
the time of its last run from this stage on, by the disk cache.  If the graph has not run yet, takes
longer than before or is at another pace, or a run has several items, the time since the start is
shown instead.
"""

from __future__ import annotations

import json
import math
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

from tactograph.graph.commands import say
from tactograph.graph.disk.disk_cache import KEPT_SUFFIX, cache_folder, read_cached, write_cached

if TYPE_CHECKING:
    from rich.progress import Progress

MIN_SHOWN_S = 2.0
"""Shorter runs show nothing."""
REDRAW_INTERVAL_S = 0.2
PRINT_INTERVAL_S = 10.0
MAX_LATE_SHARE = 0.5
"""The most of the last run's time by which one like it is early or late: another has other input,
or finds results on disk."""
TIMES_FOLDER = "times"
"""The cache folder: by graph, the start of each stage in s; under END_STAGE, the end."""
END_STAGE = ""


class ProgressLine:
    """Shows the text of `stage_of` on standard error, if `wanted`."""

    def __init__(self, *, wanted: bool = True) -> None:
        self.stage_of: Callable[[], str] = lambda: "reading and compiling"
        self._shown = wanted
        self._is_terminal = sys.stderr.isatty()
        self._printed = 0.0
        self._start = time.monotonic()
        self._begun: dict[str, float] = {}
        self._before: dict[str, float] = {}
        self._end: float | None = None
        self._share = 0.0
        self._bar: Progress | None = None
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def at(self, stage: str, share: float) -> None:
        """Show a stage; this share of the whole work is done."""
        self.stage_of, self._share = lambda: stage, share

    def recall(self, key: str) -> None:
        """Read the times of the last run of this key."""
        folder = cache_folder()
        body = folder and read_cached(folder / TIMES_FOLDER / f"{key}{KEPT_SUFFIX}")
        with suppress(ValueError):
            self._before = json.loads(body or "{}")

    def keep(self, key: str) -> None:
        """Keep the times of this run for the next one, unless results on disk made it short."""
        folder, taken = cache_folder(), time.monotonic() - self._start
        least = max(MIN_SHOWN_S, MAX_LATE_SHARE * self._before.get(END_STAGE, 0.0))
        if folder is not None and self._shown and taken > least:
            body = json.dumps({**self._begun, END_STAGE: taken}).encode()
            write_cached(folder / TIMES_FOLDER / f"{key}{KEPT_SUFFIX}", body)

    def forget_times(self) -> None:
        """Show no time left, since this run differs from the last."""
        self._before, self._end = {}, None

    def say(self, text: str, *, err: bool = False) -> None:
        """Print text in place of the line."""
        with self._lock:
            self._hide()
            say(text, err=err)

    def end(self) -> None:
        """Remove the line for good."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join()
        self._hide()

    def left(self, stage: str, now: float) -> float | None:
        """Seconds to the end of the run, `now` after its start; None if unknown."""
        if self._share:
            return now / self._share - now
        if stage in self._before and END_STAGE in self._before:
            late, whole = self._begun.get(stage, now) - self._before[stage], self._before[END_STAGE]
            self._end = whole + late if abs(late) < MAX_LATE_SHARE * whole else None
        return self._end - now if self._end is not None and self._end > now else None

    def _watch(self) -> None:
        while not self._over.wait(REDRAW_INTERVAL_S):
            now, stage = time.monotonic() - self._start, self.stage_of()
            if not self._share:
                self._begun.setdefault(stage, now)
            with self._lock:
                if not self._is_terminal:
                    self._print(stage, now)
                elif stage and now > MIN_SHOWN_S:
                    self._draw(stage, now)
                else:
                    self._hide()

    def _print(self, stage: str, now: float) -> None:
        """Print a line if the last one is old enough."""
        if stage and now - self._printed > PRINT_INTERVAL_S:
            self._printed = now
            say(f"{stage}: {self._time(stage, now)}", err=True)

    def _time(self, stage: str, now: float) -> str:
        left = self.left(stage, now)
        return f"{now:.0f} s" if left is None else f"{math.ceil(left)} s left"

    def _draw(self, stage: str, now: float) -> None:
        left = self.left(stage, now)
        if self._bar is None:
            self._bar = _make_bar()
        self._bar.update(
            self._bar.task_ids[0],
            description=stage,
            total=None if left is None else now + left,
            completed=now,
            left=self._time(stage, now),
        )
        self._bar.start()
        self._bar.refresh()

    def _hide(self) -> None:
        if self._bar is not None:
            self._bar.stop()

    def __enter__(self) -> ProgressLine:
        if self._shown:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.end()


def _make_bar() -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.fields[left]}"),
        console=Console(stderr=True, force_terminal=True),
        transient=True,
        auto_refresh=False,
        redirect_stdout=False,
        redirect_stderr=False,
    )
    bar.add_task("", total=None, left="")
    return bar
