"""The OpenCL back end: a queue that knows nodes, compiles their kernels and prepares launches."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from tactograph.graph.backends.compiled_node import Compiled
from tactograph.graph.backends.device_queue import Queue
from tactograph.graph.backends.devices import Device, choose_device
from tactograph.graph.backends.prepared_node import Prepared
from tactograph.graph.declare.engine_arguments import EVERYTHING, Wanted
from tactograph.graph.declare.node import Node


def open_device(text: str | None = None) -> tuple[OpenCL | None, str]:
    """The device to use, or None and the reason; see `choose_device`."""
    device, reason = choose_device(text)
    return (OpenCL(device) if device is not None else None), reason


class OpenCL(Queue):
    """One OpenCL device with its queue, its buffers and its compiled nodes."""

    backend = "opencl"

    def __init__(self, device: Device, lanes: Literal[1, 16] | None = None) -> None:
        super().__init__(device, lanes)
        self._compiled: dict[Node, Compiled] = {}

    def compile(self, node: Node) -> Compiled:
        """Compile a node's kernels, or return them if they are compiled already.

        Raises
        ------
        NodeError
            If the source does not match the declaration, or does not compile.
        """
        if node not in self._compiled:
            compiled = Compiled(node, self)
            # A launch function may want its kernels with constants, and never without.
            if node.kernels.launch is None:
                compiled.kernels_with({})
            self._compiled[node] = compiled
        return self._compiled[node]

    def prepare(
        self,
        node: Node,
        settings: Mapping[str, Any],
        sizes: Mapping[str, int],
        wanted: Wanted = EVERYTHING,
    ) -> Prepared:
        """Work out a node's launches over arrays of the given sizes.

        Outputs that are not wanted are left out if the node can do without them.
        """
        return Prepared(self, self.compile(node), settings, sizes, wanted)
