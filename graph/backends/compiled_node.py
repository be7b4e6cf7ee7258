"""A node's kernels, compiled for one device."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import pyopencl as cl

from tactograph.graph.backends.device_queue import Queue
from tactograph.graph.backends.kernel import Kernel
from tactograph.graph.backends.kernel_source import (
    check_kernel,
    kernel_file,
    kernel_signatures,
    kernel_source,
)
from tactograph.graph.backends.programs import build
from tactograph.graph.declare.node import Node
from tactograph.graph.errors import NodeError


class Compiled:
    """A node's kernels on one device, and the values that its launches keep."""

    def __init__(self, node: Node, queue: Queue) -> None:
        self.node = node
        self.shared: dict[Any, Any] = {}
        self._queue = queue
        self._built: dict[tuple[tuple[str, int], ...], dict[str, Kernel]] = {}

    @cached_property
    def source(self) -> str:
        """The text of the kernels, compared with the declaration.

        Raises
        ------
        NodeError
            If it is not there, or does not match.
        """
        check_kernel(self.node)
        return kernel_source(self.node)

    def kernels_with(self, constants: Mapping[str, int]) -> dict[str, Kernel]:
        """The kernels by name, built on first use with `constants`, LANES and GROUP as macros.

        Raises
        ------
        NodeError
            If the source does not match the declaration, or does not compile.
        """
        key = tuple(constants.items())
        if key not in self._built:
            self._built[key] = self._build(constants)
        return self._built[key]

    def recipe(self, constants: Mapping[str, int]) -> tuple[str, tuple[str, ...]]:
        """The source and the options of the program that holds the kernels."""
        macros = {"LANES": self._queue.lanes, "GROUP": self._queue.group, **constants}
        options = (f"-D{name}={value}" for name, value in macros.items())
        return self.source, (*self._queue.options, *options)

    def _build(self, constants: Mapping[str, int]) -> dict[str, Kernel]:
        try:
            program = build(self._queue.context, *self.recipe(constants))
        except cl.RuntimeError as error:
            lines = [line for line in str(error).splitlines() if "error" in line.lower()]
            reason = lines[0] if lines else str(error)
            raise NodeError(f"{kernel_file(self.node)} does not compile: {reason}") from None
        signatures = kernel_signatures(self.source)
        # Pipelines share a program, but not its kernels, which hold arguments.
        return {
            kernel.function_name: Kernel(kernel, signatures[kernel.function_name])
            for kernel in program.all_kernels()
        }
