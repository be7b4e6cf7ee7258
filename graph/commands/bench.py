"""``tactograph bench``: how long each node of a graph takes, on every back end and device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from statistics import median
from typing import TYPE_CHECKING

import click

from tactograph.graph.commands import RunOptions, run_options

if TYPE_CHECKING:
    from tactograph.graph.run import Result


@click.command("bench", short_help="Time a graph on every back end and device.")
@click.argument("graph")
@click.argument("values", nargs=-1, metavar="[NAME=VALUE]...")
@run_options
@click.option(
    "--repeats", type=click.IntRange(2), default=11, help="The first, which compiles, is left out."
)
def command(
    graph: str,
    values: tuple[str, ...],
    options: RunOptions,
    repeats: int,
) -> None:
    """Time GRAPH on the values given: milliseconds per node and item, medians.

    Without --backend and --device: on NumPy, then as the graph prefers on every device that
    works.  Nothing is written.
    """
    from tactograph.graph.given import read_words

    read = options.read(graph)
    given = read_words(read, values)
    for place in _places(options):
        pipeline = place.open(read, given, sinks=False)
        for line in pipeline.plan.fallbacks:
            click.echo(f"fallback: {line}", err=True)
        results = list(pipeline.items(repeats))
        _report(pipeline.plan.device or "numpy", results)


def _places(options: RunOptions) -> list[RunOptions]:
    from tactograph.graph.backends.devices import find_devices

    if options.backend is not None or options.device is not None:
        return [options]
    working = [d.name for d in find_devices() if d.works and not d.simulator]
    return [
        replace(options, backend="numpy"),
        *(replace(options, device=name) for name in working),
    ]


def _report(where: str, results: Sequence[Result]) -> None:
    """A table of the steps that run for every item, and the total."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"{where}: {len(results)} items")
    table.add_column("step", overflow="fold")
    table.add_column("back end")
    table.add_column("ms", justify="right")
    for step in results[0].plan.steps if results else ():
        task = results[0].plan.tasks.get(step.name)
        if step.stream and not (task is not None and task.node.source):
            ms = median(result.times[step.name] for result in results)
            table.add_row(step.name, step.backend, f"{ms:.3f}")
    console = Console(markup=False)
    console.print(table)
    if results:
        total = median(result.total for result in results)
        click.echo(f"an item {total:.2f} ms, {1e3 / total:.1f} items per second")
