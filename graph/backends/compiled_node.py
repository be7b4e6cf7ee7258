"""A node's kernels, compiled for one device."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pyopencl as cl

from tactograph.graph.backends.device_queue import Queue
from tactograph.graph.backends.kernel import Kernel
from tactograph.graph.backends.kernel_source import (
    kernel_file,
    kernel_signatures,
    kernel_source,
    scalar_type,
)
from tactograph.graph.backends.programs import build
from tactograph.graph.declare.node import Node
from tactograph.graph.errors import NodeError

Convert = Callable[[Any], list[Any]]
"""Converts a parameter's value to kernel arguments."""


class Compiled:
    """A node's kernels on one device, and the values that its launches keep."""

    def __init__(self, node: Node, queue: Queue) -> None:
        self.node = node
        self.converters = _converters(node)
        self.kept: dict[Any, Any] = {}
        self._queue = queue
        self._built: dict[tuple[tuple[str, int], ...], dict[str, Kernel]] = {}

    def kernels_with(self, constants: Mapping[str, int]) -> dict[str, Kernel]:
        """The kernels by name, built on first use with `constants` and LANES as macros.

        Raises
        ------
        NodeError
            If the source does not match the declaration, or does not compile.
        """
        key = tuple(constants.items())
        if key not in self._built:
            self._built[key] = _build(self.node, self._queue, constants)
        return self._built[key]


def _build(node: Node, queue: Queue, constants: Mapping[str, int]) -> dict[str, Kernel]:
    source = kernel_source(node)
    signatures = kernel_signatures(source)
    macros = [f"-D{name}={value}" for name, value in {"LANES": queue.lanes, **constants}.items()]
    try:
        program = build(queue.context, source, (*queue.options, *macros))
    except cl.RuntimeError as error:
        lines = [line for line in str(error).splitlines() if "error" in line.lower()]
        reason = lines[0] if lines else str(error)
        raise NodeError(f"{kernel_file(node)} does not compile: {reason}") from None
    # Pipelines share a program, but a kernel holds the arguments of its own next launch.
    return {
        kernel.function_name: Kernel(kernel, signatures[kernel.function_name])
        for kernel in program.all_kernels()
    }


def _converters(node: Node) -> dict[str, Convert]:
    """The converters by parameter; empty for a node whose launch function converts its own."""
    if node.kernels.grid is None:
        return {}
    return {name: _converter(p.annotation) for name, p in node.parameters.items()}


def _converter(annotation: Any) -> Convert:
    """Make a converter: a number passes as it is, a tuple item by item, a choice as its index."""
    scalar = scalar_type(annotation)
    assert scalar is not None
    c_type, count, choices = scalar
    make = np.float32 if c_type == "float" else np.int32
    if choices:
        return lambda value: [np.int32(choices.index(value))]
    if count > 1:
        return lambda value: [make(v) for v in value]
    return lambda value: [make(value)]
