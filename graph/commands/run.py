"""``tactograph run``: plan a graph and run it over all its items."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

from tactograph.graph.commands import RunOptions, run_options, say

if TYPE_CHECKING:
    from tactograph.graph.run.pipeline import Pipeline
    from tactograph.graph.run.result import Result


@click.command("run", short_help="Run a graph.")
@click.argument("graph")
@click.argument("values", nargs=-1, metavar="[NAME=VALUE]...")
@run_options
@click.option(
    "--repeats",
    type=click.IntRange(1),
    default=1,
    help="Compute each item so often; the times are then medians of all but the first.",
)
@click.option("--quiet", is_flag=True, help="Print nothing but warnings and errors.")
def command(
    graph: str,
    values: tuple[str, ...],
    options: RunOptions,
    repeats: int,
    quiet: bool,
) -> None:
    """Run GRAPH, a graph file or the name of a pipeline that ships.

    Its params are given as NAME=VALUE; 'tactograph check GRAPH' lists them.
    """
    from tactograph.graph.errors import InputError
    from tactograph.graph.run.typed_values import read_words

    read = options.read(graph)
    pipeline = options.open(read, read_words(read, values))
    for line in pipeline.plan.fallbacks:
        say(f"fallback: {line}", err=True)
    told: set[str] = set()
    count = 0
    with pipeline, _stoppable(pipeline):
        for count, result in enumerate(pipeline.items(repeats), start=1):
            for warning in result.warnings:
                if warning not in told:
                    say(f"warning: {warning}", err=True)
            # A camera's fault is reported whenever it comes back.
            told = {*(() if pipeline.endless else told), *result.warnings}
            if not quiet and (not pipeline.endless or count == 1):
                say(_summary(count, result))
    if not count:
        raise InputError(f"{read.name}: its stream ended before a first item came")
    ending = _ending(pipeline, told)
    if ending and not quiet:
        say(ending)


def _ending(pipeline: Pipeline, told: set[str]) -> str:
    """Where the results are, and whether there was a warning."""
    plan = pipeline.plan
    places = {
        str(plan.given.get(name[1:], param.default)): None
        for task in plan.tasks.values()
        if task.node.sink
        for name in task.entry.settings.values()
        if isinstance(name, str) and name.startswith("$")
        if (param := plan.graph.params[name[1:]]).kind == "path"
    }
    written = ", ".join(place for place in places if place != "None")
    warned = f"{len(told)} warning{'s' if len(told) > 1 else ''}, see above" if told else ""
    return "; ".join(filter(None, [f"written to {written}" if written else "", warned]))


@contextmanager
def _stoppable(pipeline: Pipeline) -> Iterator[None]:
    """Let Ctrl-C, or SIGTERM, end an endless stream as it should end."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    except KeyboardInterrupt:
        if not pipeline.endless:
            raise
        say("stopped", err=True)
    finally:
        signal.signal(signal.SIGTERM, before)


def _summary(number: int, result: Result) -> str:
    """Where and how long an item ran, and the figures and sentences among its outputs."""
    steps = [step for step in result.plan.steps if step.name in result.times]
    by_backend: dict[str, float] = {}
    for step in [step for step in steps if step.stream] or steps:
        task = result.plan.tasks.get(step.name)
        if task is None or not (task.node.sink or task.node.source):
            by_backend[step.backend] = by_backend.get(step.backend, 0) + result.times[step.name]
    times = ", ".join(f"{ms:.1f} ms on {backend}" for backend, ms in by_backend.items())
    figures = {
        name: figure
        for value in result.outputs.values()
        if isinstance(value, dict)
        for name, figure in value.items()
    }
    words = {name: value for name, value in result.outputs.items() if isinstance(value, str)}
    shown = {**_ranges(result), **_in_rows(figures), **words}
    width = max(map(len, shown), default=0)
    lines = [f"  {name:<{width}}  {text}" for name, text in shown.items()]
    return "\n".join([f"{number}: {times or 'done'}", *lines])


def _ranges(result: Result) -> dict[str, str]:
    """The range of each map among the outputs that has a unit."""
    import numpy as np

    found = {}
    for name, value in result.plan.outputs.items():
        port = result.plan.tasks[value.node].node.outputs[value.port]
        array = result.outputs.get(name)
        if port.kind != "array" or port.dims != ("H", "W") or port.unit == "1":
            continue
        if isinstance(array, np.ndarray) and array.dtype.kind == "f" and array.size:
            low, high = np.nanmin(array), np.nanmax(array)
            found[name] = f"{low:.4g} to {high:.4g} {port.unit}"
    return found


def _in_rows(figures: dict[str, float]) -> dict[str, str]:
    """Figures as text, the parts of one, ``x/led1``, ``x/led2``, in its row."""
    rows: dict[str, list[str]] = {}
    for name, figure in figures.items():
        whole, _, part = name.partition("/")
        # Counts in full, measurements to four digits.
        text = f"{int(figure)}" if float(figure).is_integer() else f"{figure:.4g}"
        rows.setdefault(whole, []).append(f"{part} {text}".strip().ljust(len(part) + 7))
    return {name: "  ".join(texts).rstrip() for name, texts in rows.items()}
