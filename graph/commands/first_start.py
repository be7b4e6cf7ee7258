"""The first run on a device: NumPy computes its one item while another process builds kernels.

Both give the same heights (`parity`), and for a touch NumPy takes less time than the compiler of
its kernels, unless its images are large.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from contextlib import closing, suppress
from importlib import import_module
from threading import Thread
from typing import TYPE_CHECKING, Self

import numpy as np

from tactograph.graph.backends import PREFERRED_ORDER
from tactograph.graph.backends.devices import is_new
from tactograph.graph.commands import RunOptions
from tactograph.graph.errors import TactographError, collect_warnings

if TYPE_CHECKING:
    from tactograph.graph.files.flat_graph import Graph
    from tactograph.graph.run.pipeline import Pipeline

NO_KERNELS = "no kernel is built for it yet"
LOWEST_PRIORITY = 19
"""That of POSIX."""
MAX_NUMPY_VALUES = 2 * 10**6
"""Values of the largest stack of images for NumPy: four LEDs, half a megapixel.

There a coated film takes `reconstruct` as long as its kernels take the compiler: the one grows with
the images, by 14 us of the processor a pixel, the other does not (6 s on two cores).
"""


def has_no_kernels(options: RunOptions, graph: Graph) -> bool:
    """Return whether the device has no kernel yet, and neither user nor graph insist on it."""
    insists = options.backend or options.device or options.strict
    bound = any(entry.backend for entry in graph.nodes.values())
    return not insists and not bound and graph.prefer == PREFERRED_ORDER and is_new()


def yields_one(pipeline: Pipeline) -> bool:
    """Return whether the graph has a stream, as for touches but not for fits, of one small item."""
    if (stream := pipeline.begin()) is None:
        return False
    with closing(stream), collect_warnings([]), suppress(TactographError):
        item = None if stream.reads_two() else stream.next()
        return isinstance(item, tuple) and max(map(np.size, item)) <= MAX_NUMPY_VALUES
    return False


def import_pictures() -> None:
    """Import Matplotlib in a thread, while the main one computes."""
    Thread(target=import_module, args=("tactograph.graph.show.pictures",), daemon=True).start()


class KernelBuilder:
    """Builds the kernels of a run in a process that gives way to this one, and ends with it."""

    def __init__(self, graph: str, values: Sequence[str], options: RunOptions) -> None:
        changes = [f"--with={each}" for each in options.overlays]
        changes += [f"--set={each}" for each in options.settings]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tactograph", "warm", graph, *values, *changes],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, "PYTHONSAFEPATH": "1"},
        )
        if sys.platform != "win32":
            os.setpriority(os.PRIO_PROCESS, self._process.pid, LOWEST_PRIORITY)

    def last_line(self) -> str:
        """Wait for the end, and return what it says."""
        try:
            return self._process.communicate()[0].strip().rpartition("\n")[2]
        except KeyboardInterrupt:
            return "stopped; the next run builds the rest"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with self._process:
            self._process.terminate()
