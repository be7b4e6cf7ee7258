"""``tactograph bench``: how long each node of a graph takes, on every back end and device."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import click

from tactograph.graph.commands import FILE_PATH, RunOptions, graph_command, print_table, say
from tactograph.graph.errors import InputError

if TYPE_CHECKING:
    from tactograph.graph.run.result import Result


@graph_command("bench", short_help="Time a graph on every back end and device.")
@click.option(
    "--repeats", type=click.IntRange(2), default=11, help="The first, which compiles, is left out."
)
@click.option("--out", type=FILE_PATH, help="Write a JSON file as well.")
def command(
    graph: str, values: tuple[str, ...], options: RunOptions, repeats: int, out: Path | None
) -> None:
    """Time GRAPH on these values: median milliseconds per node and item.

    Without --backend and --device it runs on NumPy, then by the graph's preference on every device
    that works.  An item is timed from its source to the last output; 'ready' is the time to the
    end of the first item, including reading, indexing and compiling.  Only --out is written.
    """
    from tactograph.graph.disk.atomic_files import write_file

    read = options.read(graph)
    arguments = read.read_words(values)
    rows = []
    for place in _places(options):
        start = time.perf_counter()
        pipeline = place.open(read, arguments, sinks=False)
        if pipeline.endless:
            raise InputError(f"{read.name}: its stream has no end; bench needs a stream that ends")
        for line in pipeline.plan.fallbacks:
            say(f"fallback: {line}", err=True)
        results: list[Result] = []
        for result in pipeline.items(repeats):
            if not results:
                # All repeats of the first item are over; only the first of them counts.
                ready = time.perf_counter() - start - 1e-3 * (repeats - 1) * result.total
            results.append(result)
        if not results:
            raise InputError(f"{read.name} yielded nothing")
        where = pipeline.plan.device or place.backend or "numpy"
        rows.append(_row(where, results, ready))
        _report(rows[-1])
    if out is not None:
        write_file(out, json.dumps(rows, indent=1) + "\n")


def _places(options: RunOptions) -> list[RunOptions]:
    from tactograph.graph.backends.devices import find_devices

    if options.backend is not None or options.device is not None:
        return [options]
    working = [d.name for d in find_devices() if d.works and not d.simulator]
    devices = [replace(options, device=name) for name in working]
    return [replace(options, backend="numpy"), *devices]


def _report(row: Mapping[str, Any]) -> None:
    """A table of the steps that run for every item, and the total."""
    steps = ((node["node"], node["backend"], f"{node['ms']:.3f}") for node in row["nodes"])
    title = f"{row['device']}: {row['items']} items"
    print_table(title, ("step", "back end", "ms"), steps)
    ready, total = row["ready_s"], row["ms"]
    rate = 1e3 / total
    say(f"an item {total:.2f} ms, {rate:.1f} items per second; ready after {ready:.1f} s")


def _row(where: str, results: Sequence[Result], ready: float) -> dict[str, Any]:
    """The figures of a device, of the steps that run for every item, sources aside."""
    plan = results[0].plan
    sources = {name for name, task in plan.tasks.items() if task.node.source}
    steps = [step for step in plan.steps if step.stream and step.name not in sources]
    nodes = [
        {"node": s.name, "backend": s.backend, "ms": median(r.times[s.name] for r in results)}
        for s in steps
    ]
    return {
        "device": where,
        "graph": plan.graph.hash,
        "items": len(results),
        "ms": median(result.total for result in results),
        "ready_s": ready,
        "nodes": nodes,
    }
