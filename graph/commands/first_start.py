"""The first run of a graph: NumPy computes its one item while another process builds its kernels.

Both give the same heights (`parity`), and for a touch NumPy takes less time than the compiler,
unless its images are large or few kernels are missing.
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
"""The builder's share of a core that others want: a tenth.  With the lowest priority, 19, it takes
twice as long on a busy machine, and the first height comes no sooner."""
MAX_NUMPY_VALUES = 2 * 10**6
"""Values of the largest stack of images for NumPy where no kernel is built: four LEDs, half a
megapixel.

There a coated film takes `reconstruct` as long as its kernels take the compiler: the one grows with
the images, by 14 us of the processor a pixel, the other with the programs (6 s on two cores).
"""


def open_soonest(
    open_it: Callable[..., Pipeline], options: RunOptions, graph: Graph
) -> tuple[Pipeline, bool]:
    """Open a graph where its first item is ready soonest; return whether its kernels are left.

    `open_it` takes further words of `open_pipeline`.
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
    """Return whether the graph has a stream, as for touches but not for fits, of one small item."""
    if pipeline.endless or (stream := pipeline.begin()) is None:
        return False
    with closing(stream), collect_warnings([]), suppress(TactographError):
        item = None if stream.reads_two() else stream.next()
        return isinstance(item, tuple) and max(map(np.size, item)) <= most
    return False


def import_pictures(plan: Plan) -> None:
    """Import Matplotlib in a thread, while the main one computes, if a node draws `pictures`."""
    if any(task.settings.get("pictures") for task in plan.tasks.values()):
        Thread(target=import_module, args=("tactograph.graph.show.pictures",), daemon=True).start()


class KernelBuilder:
    """Builds the kernels of a run in a process that gives way to this one, and ends with it.

    That process is `main` below, whose standard input ends with this one, however it does.
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
        """Wait for the end, and return what it says."""
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
