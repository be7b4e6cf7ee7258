"""The first run of a graph: NumPy computes its only item while another process builds its kernels.

Both give the same heights (`parity`).  For one touch NumPy is faster than the compiler, unless its
images are large or few kernels are missing.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from importlib import import_module
from threading import Thread
from typing import TYPE_CHECKING, Self

import numpy as np

from tactograph import __main__ as command
from tactograph.graph.backends import PREFERRED_ORDER
from tactograph.graph.commands import RunOptions
from tactograph.graph.errors import NotBuiltError, TactographError, collect_warnings

if TYPE_CHECKING:
    from tactograph.graph.files.flat_graph import Graph
    from tactograph.graph.plan.plan import Plan
    from tactograph.graph.run.pipeline import Pipeline

BUILDER_NICENESS = 10
"""Priority of the builder, which gives it a tenth of a busy core.  At the lowest priority, 19, it
takes twice as long on a busy machine, and the first height is no earlier."""
MAX_NUMPY_VALUES = 2 * 10**6
"""Largest stack of images for NumPy if no kernel is built: four LEDs with half a megapixel.

At that size `reconstruct` takes as long for a coated film as the compiler for its kernels: 14 us of
processor time a pixel, against 6 s on two cores for the programs.
"""


def open_soonest(
    open_it: Callable[..., Pipeline], options: RunOptions, graph: Graph
) -> tuple[Pipeline, bool]:
    """Open a graph where its first item is ready soonest; return whether kernels remain to build.

    `open_it` takes further arguments of `open_pipeline`.
    """
    insists = options.backend or options.device or options.strict
    bound = graph.prefer != PREFERRED_ORDER or any(each.backend for each in graph.nodes.values())
    try:
        return open_it(waits=bool(insists or bound)), False
    except NotBuiltError as missing:
        pipeline = open_it(no_device=str(missing))
        if _yields_one(pipeline, MAX_NUMPY_VALUES * missing.share):
            return pipeline, True
    return open_it(), False


def _yields_one(pipeline: Pipeline, most: float) -> bool:
    """Return whether the graph has a stream (as graphs for touches have) with one small item."""
    if pipeline.endless or (stream := pipeline.begin()) is None:
        return False
    with closing(stream), collect_warnings([]), suppress(TactographError):
        item = None if stream.reads_two() else stream.next()
        return isinstance(item, tuple) and max(map(np.size, item)) <= most
    return False


def import_pictures(plan: Plan) -> None:
    """Import Matplotlib in a thread while the main thread computes, if a node draws `pictures`."""
    if any(task.settings.get("pictures") for task in plan.tasks.values()):
        Thread(target=import_module, args=("tactograph.graph.show.pictures",), daemon=True).start()


class KernelBuilder:
    """Builds the kernels of a run in a process of low priority, which ends with this one.

    That process runs `main` below; its standard input closes when this process ends in any way.
    """

    def __init__(self, graph: str, values: Sequence[str], options: RunOptions) -> None:
        changes = [f"--with={each}" for each in options.overlays]
        changes += [f"--set={each}" for each in options.settings]
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__, "warm", graph, *values, *changes],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, "PYTHONSAFEPATH": "1"},
        )
        if sys.platform != "win32":
            os.setpriority(os.PRIO_PROCESS, self._process.pid, BUILDER_NICENESS)

    def last_line(self) -> str:
        """Wait for the builder to end, and return its last line."""
        assert self._process.stdout is not None
        try:
            return self._process.stdout.read().strip().rpartition("\n")[2]
        except KeyboardInterrupt:
            return "stopped; the next run builds the rest"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with self._process:
            self._process.terminate()


def _end_with_parent() -> None:
    os.read(sys.stdin.fileno(), 1)  # `sys.stdin` could not be closed meanwhile
    os._exit(0)


def main() -> None:
    """Run the command line as ``tactograph`` does, until the standard input ends."""
    Thread(target=_end_with_parent, daemon=True).start()
    command.main()


if __name__ == "__main__":
    main()
