"""The host's compiled back end: a node's loop over pixels, compiled by numba, on all cores.

``kernels/<name>_numba.py`` holds the function of the node's name.  It takes what the OpenCL
kernel takes, in the same order, without the sizes, which the arrays know; then the first of the
rows that it is to do, and the one behind the last.  What is compiled stays on disk.

This module is imported when a plan places a node here, not before: numba takes its time.
"""

from __future__ import annotations

import inspect
import os
import typing
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from importlib import import_module
from itertools import zip_longest
from typing import Any

import numba
import numpy as np
from numba import types
from numpy.typing import NDArray

from tactograph.graph.backends.kernel_source import scalar_type
from tactograph.graph.errors import NodeError, warn
from tactograph.graph.node import Node, Parameter
from tactograph.graph.ports import PortType
from tactograph.graph.wanted import EVERYTHING, Wanted

PIECE = 16384
"""Elements that are worth a thread's while."""
ROWS = ("first", "last")


class Compiled:
    """A node's compiled function, which is called as the node itself is.

    Inputs stay as they are; outputs are new arrays.
    """

    def __init__(self, node: Node) -> None:
        self.node = node
        self.poison: int | None = None
        """A byte that outputs are filled with before they are made, for tests."""
        self._functions: dict[tuple[int, ...], Callable[..., None]] = {}
        self._choices = {name: _choices(p) for name, p in node.parameters.items()}
        if not node.fixed:
            self._function({})

    def __call__(self, *args: Any, **keywords: Any) -> Any:
        node = self.node
        inputs = _by_port(node, args)
        sizes = _sizes(node, inputs, keywords)
        wanted: Wanted = keywords.get(node.wanted or "", EVERYTHING)
        outputs = {
            name: self._empty(node.output_shape(name, sizes), port) if name in wanted else None
            for name, port in node.outputs.items()
        }
        arguments = [
            *(_as_argument(value, node.inputs[name]) for name, value in inputs.items()),
            *(_as_argument(value, node.outputs[name]) for name, value in outputs.items()),
            *self._settings(keywords),
        ]
        function = self._function(sizes)
        assert node.rows is not None
        elements = max(array.size for array in outputs.values() if array is not None)
        _share(lambda *rows: function(*arguments, *rows), sizes[node.rows], elements)
        made = tuple(outputs.values())
        return made[0] if node.output_record is None else node.output_record(*made)

    def _settings(self, given: Mapping[str, Any]) -> Iterator[Any]:
        """The parameters, a choice by its index."""
        for name, parameter in self.node.parameters.items():
            value, choices = given.get(name, parameter.default), self._choices[name]
            yield choices.index(value) if choices else value

    def _empty(self, shape: tuple[int, ...], port: PortType) -> NDArray[Any]:
        array: NDArray[Any] = np.empty(shape, port.dtype)
        if self.poison is not None:
            array.view(np.uint8)[...] = self.poison
        return array

    def _function(self, sizes: Mapping[str, int]) -> Callable[..., None]:
        """The function compiled for the sizes that are fixed when it is."""
        fixed = tuple(sizes[symbol] for symbol in self.node.fixed)
        if fixed not in self._functions:
            self._functions[fixed] = _compiled(self.node, fixed)
        return self._functions[fixed]


def _compiled(node: Node, fixed: tuple[int, ...]) -> Callable[..., None]:
    """Compile the node's function, or read it from disk.

    Raises
    ------
    NodeError
        If there is no such function, or its arguments are not the declaration's.
    """
    file = f"{node.name}_numba"
    try:
        found = getattr(import_module(f"{node.kernel_package}.{file}"), node.name)
    except (ModuleNotFoundError, AttributeError) as error:
        raise NodeError(f"node '{node.name}': {node.kernel_package}: {error}") from error
    function = found(*fixed) if fixed else found
    expected, kinds = zip(*_arguments(node), strict=True)
    names = tuple(name.rstrip("_") for name in inspect.signature(function).parameters)
    if names != expected:
        raise NodeError(
            f"{file}.py: the function takes {', '.join(names)}; "
            f"the declaration says {', '.join(expected)}"
        )
    options = {"nogil": True, "error_model": "numpy"}
    try:
        compiled = numba.njit(types.void(*kinds), cache=True, **options)(function)
    except RuntimeError as error:
        if "cannot cache" not in str(error):
            raise
        warn(
            f"{node.name} is compiled at every start: numba finds no folder to keep it in "
            "(NUMBA_CACHE_DIR names one)"
        )
        compiled = numba.njit(types.void(*kinds), **options)(function)
    return typing.cast("Callable[..., None]", compiled)


def _arguments(node: Node) -> Iterator[tuple[str, Any]]:
    """Name and numba's type of each argument: inputs, outputs, parameters, rows."""
    for port in node.inputs.values():
        if port.kind == "array":
            kind = types.Array(numba.from_dtype(port.dtype), len(port.dims), "C", readonly=True)
            yield port.name.replace(".", "_"), kind
        elif port.kind == "number":
            yield port.name.replace(".", "_"), types.float32
    for port in node.outputs.values():
        name = port.name if node.output_record else "out"
        yield name, types.Array(numba.from_dtype(port.dtype), len(port.dims), "C")
    for parameter in node.parameters.values():
        found = scalar_type(parameter.annotation)
        if found is None or found[1] != 1:
            raise NodeError(
                f"node '{node.name}': no compiled function can take its parameter "
                f"'{parameter.name}'"
            )
        yield parameter.name, types.float32 if found[0] == "float" else types.intp
    for name in ROWS:
        yield name, types.intp


def _choices(parameter: Parameter) -> tuple[Any, ...]:
    """What a parameter's index counts, if it is a choice."""
    found = scalar_type(parameter.annotation)
    return found[2] if found else ()


def _by_port(node: Node, args: tuple[Any, ...]) -> dict[str, Any]:
    """The inputs, records taken apart; None for one that is left out."""
    inputs: dict[str, Any] = {}
    names = dict.fromkeys(name.partition(".")[0] for name in node.inputs)
    for name, value in zip_longest(names, args):
        if name in node.input_records:
            inputs |= {f"{name}.{field}": part for field, part in value._asdict().items()}
        else:
            inputs[name] = value
    return inputs


def _sizes(node: Node, inputs: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, int]:
    sizes: dict[str, int] = {}
    for name, port in node.inputs.items():
        if port.kind == "array" and inputs[name] is not None:
            for dim, size in zip(port.dims, inputs[name].shape, strict=True):
                if isinstance(dim, str):
                    sizes[dim] = size
    for symbol, parts in node.derived.items():
        settled = {parts.by: settings.get(parts.by, node.parameters[parts.by].default)}
        sizes.setdefault(symbol, parts.size(sizes[parts.of], settled))
    return sizes


def _as_argument(value: Any, port: PortType) -> Any:
    """An array as one piece of memory; one that is not there as an array of no size."""
    if port.kind != "array":
        return value
    return (
        np.empty((0,) * len(port.dims), port.dtype)
        if value is None
        else np.ascontiguousarray(value)
    )


def _share(work: Callable[[int, int], object], rows: int, elements: int) -> None:
    """Call `work` with the first and the end of some rows, for all of them, in threads."""
    count = min(rows, 4 * (os.cpu_count() or 1), elements // PIECE)
    if count < 2:
        work(0, rows)
        return
    ends = [rows * i // count for i in range(count + 1)]
    for _ in _threads().map(work, ends[:-1], ends[1:]):
        pass


@cache
def _threads() -> ThreadPoolExecutor:
    """Threads for all nodes; they take turns with one another, and end with the process."""
    return ThreadPoolExecutor(os.cpu_count())
