"""``tactograph run``: plan a graph and run it over all its items."""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, redirect_stdout
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tactograph import ctrl_c
from tactograph.graph.commands import RunOptions, graph_command, say
from tactograph.graph.errors import InputError

if TYPE_CHECKING:
    from types import FrameType

    from tactograph.graph.commands.progress_line import ProgressLine
    from tactograph.graph.run.pipeline import Pipeline
    from tactograph.graph.run.result import Result

FRAME_MS = 1000 / 30
"""Time of a camera's frame; for an item that took longer, the slowest node is named."""
HEADLINE_NAMES = {"summary", "verdict"}
"""Names of outputs that sum an item up."""
WARNING_INTERVAL_S = 10.0
"""Pause after which a recurring warning of an endless stream is printed again."""


@graph_command("run", short_help="Run a graph.")
@click.option(
    "--keep",
    metavar="PORTS",
    help="Write values from inside, such as label.misfit,light, into OUT/kept.",
)
@click.option(
    "--all", "every", is_flag=True, expose_value=False,
    help="With --help after a graph: list the parameters of its nodes, too.",
)  # fmt: skip
@click.option(
    "--figures", is_flag=True, help="Print all figures, even if a sentence states the main ones."
)
@click.option("--quiet", is_flag=True, help="Print nothing but warnings and errors.")
def command(**words: Any) -> None:
    """Run GRAPH, a graph file or the name of a pipeline that ships.

    Its params are given as NAME=VALUE; 'tactograph check GRAPH' lists them.
    """
    from tactograph.graph.commands.progress_line import ProgressLine

    arguments = _Arguments(**words)
    with ExitStack() as closing:
        line = closing.enter_context(ProgressLine(wanted=not arguments.quiet))
        if arguments.quiet:  # without the output of nodes, such as live figures
            nowhere = closing.enter_context(Path(os.devnull).open("w"))
            closing.enter_context(redirect_stdout(nowhere))
        _run_all(arguments, line)


@dataclass(frozen=True)
class _Arguments:
    """The arguments and options of the command."""

    graph: str
    values: tuple[str, ...]
    options: RunOptions
    keep: str | None
    figures: bool
    quiet: bool


def _run_all(arguments: _Arguments, line: ProgressLine) -> None:
    from tactograph.graph.commands import first_start
    from tactograph.graph.run.keep_values import read_selection

    options, read = arguments.options, arguments.options.read(arguments.graph)
    params = read.read_words(arguments.values)
    selection = read_selection(arguments.keep, read) if arguments.keep is not None else {}
    open_it = partial(options.open, read, params, outputs={**read.outputs, **selection})
    pipeline, leaves_kernels = first_start.open_soonest(open_it, options, read)
    if not leaves_kernels:
        _run_pipeline(pipeline, arguments, line, selection)
        return
    with first_start.KernelBuilder(arguments.graph, arguments.values, options) as builder:
        first_start.import_pictures(pipeline.plan)
        _run_pipeline(pipeline, arguments, line, selection)
        tell = (lambda _: None) if arguments.quiet else say
        tell(f"{read.name}: kernels are being built for later runs; Ctrl-C is safe")
        tell(builder.last_line())


def _run_pipeline(
    pipeline: Pipeline, arguments: _Arguments, line: ProgressLine, selection: Mapping[str, str]
) -> None:
    report = _Report(line, pipeline, arguments)
    for fallback in pipeline.plan.fallbacks:
        line.say(f"fallback: {fallback}", err=True)
    line.stage_of = lambda: pipeline.stage
    try:
        _run_items(pipeline, report, selection)
    finally:
        report.warnings(pipeline.closing_warnings)
    line.end()
    ending = _ending(pipeline, report.last_due)
    if ending and not arguments.quiet:
        say(ending)


def _run_items(pipeline: Pipeline, report: _Report, selection: Mapping[str, str]) -> None:
    """Run all items, and write the selected values."""
    from tactograph.graph.run.keep_values import write_selection

    folder = _out_folder(pipeline) / "kept"
    count = 0
    try:
        with pipeline, _stoppable(pipeline) as stop_if_asked:
            for count, result in enumerate(pipeline.items(), start=1):
                if selection:
                    write_selection(result, selection, folder / str(count))
                report.item(count, result)
                stop_if_asked()
            # Not after Ctrl-C, which may come when an item's files are there but it has not ended.
            if not count:
                name = pipeline.plan.graph.name
                raise InputError(f"{name}: its stream ended before the first item")
    except InputError as error:
        if error.item and not pipeline.endless:
            error.args = (f"{error}; 'tactograph batch' continues after a capture that fails",)
        raise


def _out_folder(pipeline: Pipeline) -> Path:
    graph = pipeline.plan.graph
    default = graph.params["out"].default if "out" in graph.params else "."
    return Path(str(pipeline.plan.arguments.get("out", default)))


class _Report:
    """The lines that a run prints.

    `last_due` has the time at which each warning last occurred; warnings of an endless stream count
    without their figures, which differ from item to item.
    """

    def __init__(self, line: ProgressLine, pipeline: Pipeline, arguments: _Arguments) -> None:
        self._line, self._pipeline, self._arguments = line, pipeline, arguments
        self.last_due: dict[str, float] = {}
        self._last_kind = ""

    def item(self, number: int, result: Result) -> None:
        """Print the warnings and the figures of an item.

        For an endless stream, print the first item, and each item whose sentence differs from the
        last in more than its numbers: a touch that begins or ends.
        """
        from tactograph.graph.run.raise_warnings import warning_kind

        endless = self._pipeline.endless
        if endless:
            self._news(result.warnings)
        else:
            name = _name_of(result)
            self.warnings(result.warnings[: result.shared_warnings])
            self.warnings(result.warnings[result.shared_warnings :], f"{name}: " if name else "")
        kind = warning_kind(" ".join(v for v in result.outputs.values() if isinstance(v, str)))
        news, self._last_kind = number == 1 or kind != self._last_kind, kind
        if not self._arguments.quiet and (not endless or news):
            self._line.say(_summary(number, result, figures=self._arguments.figures))
        if endless:
            self._line.end()

    def warnings(self, warnings: Iterable[str], of: str = "") -> None:
        """Print new warnings, `of` a named item."""
        for warning in (f"{of}{each}" for each in warnings):
            if warning not in self.last_due:
                self._line.say(f"warning: {warning}", err=True)
                self.last_due[warning] = 0.0

    def _news(self, warnings: Iterable[str]) -> None:
        """Print kinds of warnings that have not occurred for a while, such as a camera's faults."""
        from tactograph.graph.run.raise_warnings import warning_kind

        now = time.monotonic()
        for warning in warnings:
            kind = warning_kind(warning)
            if now - self.last_due.get(kind, -math.inf) > WARNING_INTERVAL_S:
                self._line.say(f"warning: {warning}", err=True)
            self.last_due[kind] = now


def _ending(pipeline: Pipeline, warnings: Collection[str]) -> str:
    """The last line: where the results are, and the number of warnings."""
    plan = pipeline.plan
    places = {
        str(plan.arguments.get(name, param.default)): None
        for task in plan.tasks.values()
        if task.node.sink
        for name in task.entry.params.values()
        if (param := plan.graph.params[name]).kind == "path"
    }
    written = ", ".join(place for place in places if Path(place).exists())
    plural = "s" if len(warnings) > 1 else ""
    warned = f"{len(warnings)} warning{plural}, see above" if warnings else ""
    return "; ".join(filter(None, [f"written to {written}" if written else "", warned]))


@contextmanager
def _stoppable(pipeline: Pipeline) -> Iterator[Callable[[], None]]:
    """Let Ctrl-C or SIGTERM end an endless stream properly.

    Python drops an interrupt that arrives while it frees an object.  The yielded function raises it
    again, between items.
    """
    is_stopping = False

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal is_stopping
        is_stopping = True
        ctrl_c.interrupt(number, frame)

    def stop_if_asked() -> None:
        if is_stopping:
            raise KeyboardInterrupt

    # Background jobs of a shell ignore Ctrl-C, and continue to do so.
    signals = [signal.SIGTERM]
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signals.append(signal.SIGINT)
    before = {number: signal.signal(number, interrupt) for number in signals}
    try:
        yield stop_if_asked
    except KeyboardInterrupt:
        if not pipeline.endless:
            raise
        say("stopped", err=True)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _summary(number: int, result: Result, *, figures: bool) -> str:
    """The sentences among the outputs of an item, or its figures, and its time.

    If a graph has sentences among its outputs, figures are printed only on request.
    """
    texts = {name: value for name, value in result.outputs.items() if isinstance(value, str)}
    rows = dict(texts)
    if figures or not texts:
        rows |= {**_ranges(result), **_in_rows(result.figures)}
    head = " ".join(filter(None, [str(number), _name_of(result)]))
    first = _times(result) or "done"
    # One of several that says nothing of the others stands with its name.
    if headline := next((n for n in texts if n in HEADLINE_NAMES or len(texts) == 1), None):
        first = f"{rows.pop(headline)} ({first})"
    width = max(map(len, rows), default=0)
    return "\n".join([f"{head}: {first}", *(f"  {name:<{width}}  {t}" for name, t in rows.items())])


def _times(result: Result) -> str:
    """Milliseconds on each back end, and the slowest node of a long item.

    Sources and sinks of a stream do not count: files and pictures take longer than a height.
    """
    times, tasks = result.times, result.plan.tasks
    steps = [s for s in result.plan.steps if s.name in times]
    ends = {name for name, task in tasks.items() if task.node.sink or task.node.source}
    if of_stream := [s for s in steps if s.stream]:
        steps = [s for s in of_stream if s.name not in ends]
    by_backend: dict[str, float] = {}
    for step in steps:
        by_backend[step.backend] = by_backend.get(step.backend, 0) + times[step.name]
    listed = ", ".join(f"{ms:.1f} ms on {backend}" for backend, ms in by_backend.items())
    nodes = [step.name for step in steps if step.name in tasks]
    if not nodes or sum(by_backend.values()) < FRAME_MS:
        return listed
    slowest = max(nodes, key=lambda name: times[name])
    return f"{listed}; slowest: {slowest} ({tasks[slowest].node.name}) {times[slowest]:.1f} ms"


def _name_of(result: Result) -> str:
    """The name of the item, if the stream's source yields one."""
    names = (output for value, output in result.item.items() if value.port == "name")
    return next((name for name in names if isinstance(name, str)), "")


def _ranges(result: Result) -> dict[str, str]:
    """The range of each map among the outputs that has a unit."""
    import numpy as np

    ranges = {}
    for name in result.plan.outputs:
        port, array = result.plan.port(name), result.outputs.get(name)
        if port.kind != "array" or port.dims != ("H", "W") or port.unit == "1":
            continue
        if isinstance(array, np.ndarray) and array.dtype.kind == "f" and array.size:
            low, high = np.nanmin(array), np.nanmax(array)
            ranges[name] = f"{low:.4g} to {high:.4g} {port.unit}"
    return ranges


def _in_rows(figures: dict[str, float]) -> dict[str, str]:
    """Figures as text; the parts of one, ``x/led1``, ``x/led2``, follow it in its row."""
    rows: dict[str, list[str]] = {}
    for name, figure in figures.items():
        whole, _, part = name.partition("/")
        # Counts in full, measurements to four digits.
        text = f"{int(figure)}" if float(figure).is_integer() else f"{figure:.4g}"
        if isinstance(figure, bool):
            text = "yes" if figure else "no"
        row = rows.setdefault(whole, [])
        row.insert(len(row) if part else 0, f"{part} {text}".strip().ljust(len(part) + 7))
    return {name: "  ".join(texts).rstrip() for name, texts in rows.items()}
