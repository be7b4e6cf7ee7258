"""The OpenCL back end: a queue that knows nodes, compiles their kernels and prepares launches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext, suppress
from typing import Any, Literal

import pyopencl as cl

from tactograph.graph.backends.build_ahead import build_ahead
from tactograph.graph.backends.compiled_node import Compiled
from tactograph.graph.backends.device_queue import Queue
from tactograph.graph.backends.devices import Device, choose_device
from tactograph.graph.backends.prepared_node import Prepared
from tactograph.graph.backends.programs import Recipe, build, silent_stderr
from tactograph.graph.declare.engine_arguments import EVERYTHING, Wanted
from tactograph.graph.declare.node import Node
from tactograph.graph.errors import NodeError


def open_device(text: str | None = None, *, waits: bool = True) -> tuple[OpenCL | None, str]:
    """The device to use, or None and the reason; see `choose_device`."""
    device, reason = choose_device(text, waits=waits)
    return (OpenCL(device, waits=waits) if device is not None else None), reason


class OpenCL(Queue):
    """One OpenCL device with its queue, its buffers and its compiled nodes.

    `waits`: whether the caller waits if kernels have to be compiled first.
    """

    def __init__(
        self, device: Device, lanes: Literal[1, 16] | None = None, *, waits: bool = True
    ) -> None:
        super().__init__(device, lanes)
        self._waits = waits
        self._compiled: dict[Node, Compiled] = {}

    def compile(self, nodes: Sequence[Node]) -> None:
        """Check the sources of nodes' kernels, and begin to build those that are not on disk.

        A kernel is built when it is first launched, unless another process has built it by then.

        Raises
        ------
        NodeError
            If a source does not match its declaration.
        NotBuiltError
            If needed kernels are not built, and the caller does not wait.
        """
        programs = self._programs(nodes)
        longest_first = sorted(programs, key=lambda node: len(programs[node][0]), reverse=True)
        needed = [programs[node] for node in longest_first if node.is_idle is None]
        perhaps = [programs[node] for node in longest_first if node.is_idle is not None]
        build_ahead(self.context, needed, perhaps, waits=self._waits)

    def build(self, nodes: Sequence[Node]) -> int:
        """Build nodes' kernels, with helpers, and keep them on disk; return the number of programs.

        A program that does not compile without constants of its launch is left to the launch.
        """
        self.compile(nodes)
        count = 0
        for source, options in {*self._programs(nodes).values()}:
            with suppress(cl.RuntimeError), silent_stderr():
                build(self.context, source, options)
                count += 1
        return count

    def _programs(self, nodes: Sequence[Node]) -> dict[Node, Recipe]:
        """The programs of nodes without constants of a launch."""
        programs: dict[Node, Recipe] = {}
        for node in nodes:
            # A launch function may use only a library's kernels.
            with suppress(NodeError) if node.kernels.launch else nullcontext():
                programs[node] = self.compiled(node).recipe({})
        return programs

    def compiled(self, node: Node) -> Compiled:
        """A node's kernels."""
        if node not in self._compiled:
            self._compiled[node] = Compiled(node, self)
        return self._compiled[node]

    def prepare(
        self,
        node: Node,
        settings: Mapping[str, Any],
        sizes: Mapping[str, int],
        wanted: Wanted = EVERYTHING,
    ) -> Prepared:
        """Prepare a node's launches on arrays of the given sizes.

        Outputs that are not wanted are left out if the node allows it.
        """
        return Prepared(self, self.compiled(node), settings, sizes, wanted)
