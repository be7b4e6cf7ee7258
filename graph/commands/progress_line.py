"""A progress line on the terminal after two seconds: the present stage, and the elapsed time.

If standard error is a file or a pipe, a line is printed every ten seconds.  For many captures or
runs it shows the remaining time, estimated from the finished share.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from tactograph.graph.commands import say
from tactograph.graph.show.warning_lines import warning_lines

if TYPE_CHECKING:
    from rich.progress import Progress

MIN_SHOWN_S = 2.0
"""Shorter runs show nothing."""
REDRAW_INTERVAL_S = 0.2
PRINT_INTERVAL_S = 10.0


class ProgressLine:
    """Shows the text of `stage_of` on standard error, if `wanted`."""

    def __init__(self, *, wanted: bool = True) -> None:
        self.stage_of: Callable[[], str] = lambda: "reading and compiling"
        self._shown = wanted
        self._is_terminal = sys.stderr.isatty()
        self._printed = 0.0
        self._start = time.monotonic()
        self._share = 0.0
        self._bar: Progress | None = None
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def at(self, stage: str, share: float) -> None:
        """Show a stage; this share of the whole work is done."""
        self.stage_of, self._share = lambda: stage, share

    def say(self, text: str, *, err: bool = False) -> None:
        """Print text in place of the line."""
        with self._lock:
            self._hide()
            say(text, err=err)

    def warnings(self, warned: Iterable[tuple[str, Iterable[str]]]) -> None:
        """Print the warnings of many runs in few lines, with the run that first gave each."""
        for text in warning_lines(warned):
            self.say(text, err=True)

    def end(self) -> None:
        """Remove the line for good."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join()
        self._hide()

    def remaining_s(self, now: float) -> float | None:
        """Seconds to the end of the work, `now` after its start; None if unknown."""
        return now / self._share - now if self._share else None

    def _watch(self) -> None:
        while not self._over.wait(REDRAW_INTERVAL_S):
            now, stage = time.monotonic() - self._start, self.stage_of()
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
            say(f"{stage}: {self._time(now)}", err=True)

    def _time(self, now: float) -> str:
        remaining = self.remaining_s(now)
        return f"{now:.0f} s" if remaining is None else f"{remaining:.0f} s left"

    def _draw(self, stage: str, now: float) -> None:
        remaining = self.remaining_s(now)
        if self._bar is None:
            self._bar = _make_bar()
        self._bar.update(
            self._bar.task_ids[0],
            description=stage,
            total=None if remaining is None else now + remaining,
            completed=now,
            remaining_text=self._time(now),
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
        TextColumn("{task.fields[remaining_text]}"),
        console=Console(stderr=True, force_terminal=True),
        transient=True,
        auto_refresh=False,
        redirect_stdout=False,
        redirect_stderr=False,
    )
    bar.add_task("", total=None, remaining_text="")
    return bar
