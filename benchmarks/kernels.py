"""How an item's time divides into kernels and the gaps between them, by the device's own clock.

    python benchmarks/kernels.py reconstruct capture=press calibration=cal.npz
    python benchmarks/kernels.py precise capture=press calibration=cal.npz --outputs height,error

In a gap, from the end of a kernel to the start of the next, the device waits for the host, which
decides, computes, or takes its time to enqueue.  Medians over many runs of one item.
"""

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from statistics import median
from typing import Any, NamedTuple
from unittest import mock

import click
import pyopencl as cl
from rich.console import Console
from rich.table import Table

from tactograph.graph import TactographError, load
from tactograph.graph.backends.kernel import Kernel
from tactograph.graph.files.read_graph import read_graph

Launches = list[tuple[str, cl.Event]]
MOST_ROWS = 25


class Spent(NamedTuple):
    """Of one item: milliseconds on the wall, by kernel, and by gap; how often each kernel ran."""

    wall: float
    kernels: dict[str, float]
    gaps: dict[str, float]
    counts: Counter[str]


@click.command()
@click.argument("graph")
@click.argument("values", nargs=-1, metavar="[NAME=VALUE]...")
@click.option("--outputs", default="height", show_default=True, help="Compute no others.")
@click.option("--rounds", default=15, show_default=True)
def main(graph: str, values: tuple[str, ...], outputs: str, rounds: int) -> None:
    """Run the first item of GRAPH again and again; print its kernels and gaps."""
    launches: Launches = []
    with watched(launches):
        try:
            read = read_graph(graph)
            params = read.read_words(values)
            pipeline = load(read, backend="opencl", outputs=outputs.split(","), **params)
            found = [measure(pipeline, launches) for _ in range(rounds + 3)][3:]
        except TactographError as error:
            raise click.ClickException(str(error)) from None
    show(found)


@contextmanager
def watched(launches: Launches) -> Iterator[None]:
    """Take down the name and the event of every kernel that is enqueued."""
    bind = Kernel.bind

    def noted(kernel: Kernel, *there: Any) -> Callable[[], cl.Event]:
        launch = bind(kernel, *there)

        def again() -> cl.Event:
            launches.append((kernel.name, event := launch()))
            return event

        return again

    with mock.patch.object(Kernel, "bind", noted):
        yield


def measure(pipeline: Any, launches: Launches) -> Spent:
    """Compute the stream's first item."""
    launches.clear()
    start = time.perf_counter()
    next(iter(pipeline.items()))
    wall = 1e3 * (time.perf_counter() - start)
    spans = [(name, 1e-6 * done.profile.start, 1e-6 * done.profile.end) for name, done in launches]
    kernels: defaultdict[str, float] = defaultdict(float)
    gaps: defaultdict[str, float] = defaultdict(float)
    for name, start, end in spans:
        kernels[name] += end - start
    for (before, _, end), (after, start, _) in pairwise(spans):
        gaps[f"{before} to {after}"] += max(start - end, 0)
    return Spent(wall, dict(kernels), dict(gaps), Counter(name for name, _ in launches))


def show(found: list[Spent]) -> None:
    """Print medians, the longest first."""
    wall = median(each.wall for each in found)
    busy = median(sum(each.kernels.values()) for each in found)
    idle = median(sum(each.gaps.values()) for each in found)
    number = found[-1].counts.total()
    print(f"{wall:.1f} ms on the wall: {number} kernels take {busy:.1f}, the gaps {idle:.1f}")
    table = Table("kernel", "launches", "ms")
    for name, spent in longest([each.kernels for each in found]):
        table.add_row(name, str(found[-1].counts[name]), f"{spent:.2f}")
    Console(width=100).print(table)
    table = Table("gap", "ms")
    for name, spent in longest([each.gaps for each in found]):
        table.add_row(name, f"{spent:.2f}")
    Console(width=100).print(table)


def longest(found: list[dict[str, float]]) -> list[tuple[str, float]]:
    """What takes longest, by the median of all items."""
    names = {name for each in found for name in each}
    spent = {name: median(each.get(name, 0.0) for each in found) for name in names}
    return sorted(spent.items(), key=lambda pair: -pair[1])[:MOST_ROWS]


if __name__ == "__main__":
    main()
