"""The host's compiled back end: a node's loop over pixels, compiled by numba, on all cores.

``kernels/<name>_numba.py`` holds the function of the node's name.  It takes what the OpenCL
kernel takes, in the same order, without the sizes, which the arrays know; then the first of the
rows that it is to do, and the one behind the last.  What is compiled stays on disk.

This module is imported when a plan places a node here, not before: numba takes its time.
"""

from __future__ import annotations

import inspect
import math
import os
import re
import typing
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from importlib import import_module
from itertools import pairwise, zip_longest
from typing import Any

import numba
import numpy as np
from numba import types
from numba.core.errors import NumbaError

from tactograph.graph.backends.kernel_source import scalar_type
from tactograph.graph.declare.node import Node, Parameter
from tactograph.graph.declare.ports import PortType
from tactograph.graph.declare.wanted_outputs import EVERYTHING, Wanted
from tactograph.graph.errors import NodeError, warn

inlined = numba.njit(
    forceinline=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True
)
"""For what a node's function calls: made a part of its loop, and of use there alone."""

PIECE = 16384
"""Elements that are worth a thread's while."""
ROWS = ("first", "last")


@dataclass(frozen=True)
class _Call:
    """What is the same in every call on arrays of the same sizes, with the same settings.

    Outputs are given by shape and type, without size where they are not wanted; `ends` are the
    rows at which threads divide the work.
    """

    function: Callable[..., None]
    settings: tuple[Any, ...]
    outputs: list[tuple[tuple[int, ...], Any]]
    wanted: list[bool]
    ends: list[int]


class Compiled:
    """A node's compiled function, which is called as the node itself is.

    Inputs stay as they are; outputs are new arrays.
    """

    def __init__(self, node: Node) -> None:
        self.node = node
        self.poison: int | None = None
        """A byte that outputs are filled with before they are made, for tests."""
        self._functions: dict[tuple[int, ...], Callable[..., None]] = {}
        self._calls: dict[Hashable, _Call] = {}
        if not node.fixed:
            self._function(())

    def __call__(self, *args: Any, **keywords: Any) -> Any:
        ports = self.node.inputs.values()
        inputs = [_as_argument(value, port) for port, value in zip_longest(ports, args)]
        key = (*map(np.shape, inputs), *keywords.items())
        call = self._calls.get(key)
        if call is None:
            call = self._calls[key] = self._call(inputs, keywords)
        outputs = [np.empty(*each) for each in call.outputs]
        if self.poison is not None:
            for array in outputs:
                array.view(np.uint8)[...] = self.poison
        _share(partial(call.function, *inputs, *outputs, *call.settings), call.ends)
        made = [a if wanted else None for a, wanted in zip(outputs, call.wanted, strict=True)]
        return made[0] if self.node.output_record is None else self.node.output_record(*made)

    def _call(self, inputs: Sequence[Any], keywords: Mapping[str, Any]) -> _Call:
        """Work out what a call on such inputs takes."""
        node = self.node
        sizes: dict[str, int] = {}
        for port, value in zip(node.inputs.values(), inputs, strict=True):
            known = zip(port.dims, np.shape(value), strict=True)
            sizes |= {dim: size for dim, size in known if isinstance(dim, str) and size}
        settings = {n: keywords.get(n, p.default) for n, p in node.parameters.items()}
        for symbol, parts in node.derived.items():
            sizes.setdefault(symbol, parts.size(sizes[parts.of], settings))
        wanted: Wanted = keywords.get(node.wanted or "", EVERYTHING)
        shapes = {
            name: node.output_shape(name, sizes) if name in wanted else (0,) * len(port.dims)
            for name, port in node.outputs.items()
        }
        assert node.rows is not None
        rows, elements = sizes[node.rows], max(map(math.prod, shapes.values()))
        count = max(1, min(rows, 4 * (os.cpu_count() or 1), elements // PIECE))
        return _Call(
            function=self._function(tuple(sizes[symbol] for symbol in node.fixed)),
            settings=tuple(_number(value, node.parameters[n]) for n, value in settings.items()),
            outputs=[(shape, node.outputs[name].dtype) for name, shape in shapes.items()],
            wanted=[name in wanted for name in shapes],
            ends=[rows * i // count for i in range(count + 1)],
        )

    def _function(self, fixed: tuple[int, ...]) -> Callable[..., None]:
        """The function compiled for the sizes that are fixed when it is."""
        if fixed not in self._functions:
            self._functions[fixed] = _compiled(self.node, fixed)
        return self._functions[fixed]


def _compiled(node: Node, fixed: tuple[int, ...]) -> Callable[..., None]:
    """Compile the node's function, or read it from disk.

    Raises
    ------
    NodeError
        If there is no such function, its arguments are not the declaration's, or it does
        not compile.
    """
    file = f"{node.name}_numba"
    try:
        found = getattr(import_module(f"{node.kernel_package}.{file}"), node.name)
    except (ModuleNotFoundError, AttributeError, SyntaxError) as error:
        raise NodeError(f"node '{node.name}': {node.kernel_package}: {error}") from error
    try:
        function = found(*fixed) if fixed else found
    except TypeError:
        raise NodeError(
            f"node '{node.name}': {file}.py: the function has to take {', '.join(node.fixed)}, "
            "and to return the function that takes the arguments"
        ) from None
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
    except NumbaError as error:
        raise NodeError(f"node '{node.name}': {file}.py: {_first_cause(error)}") from None
    except RuntimeError as error:
        if "cannot cache" not in str(error):
            raise
        warn(
            f"{node.name} is compiled at every start: numba finds no folder to keep it in "
            "(NUMBA_CACHE_DIR names one)"
        )
        compiled = numba.njit(types.void(*kinds), **options)(function)
    return typing.cast("Callable[..., None]", compiled)


def _first_cause(error: NumbaError) -> str:
    """A line of numba's many: where, and what."""
    text = re.sub(r"\x1b\[[0-9;]*m", "", str(error))
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    what = next((line for line in lines if not line.startswith("Failed in")), "does not compile")
    where = re.search(r'File "[^"]*", line (\d+)', text)
    return f"line {where[1]}: {what}" if where else what


def _arguments(node: Node) -> Iterator[tuple[str, Any]]:
    """Name and numba's type of each argument: inputs, outputs, parameters, rows."""
    for port in node.inputs.values():
        yield port.name, _array(port, readonly=True) if port.kind == "array" else types.float32
    for port in node.outputs.values():
        yield port.name if node.output_record else "out", _array(port, readonly=False)
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


def _array(port: PortType, *, readonly: bool) -> Any:
    return types.Array(numba.from_dtype(port.dtype), len(port.dims), "C", readonly=readonly)


def _number(value: Any, parameter: Parameter) -> Any:
    """A parameter's value; of a choice its index."""
    found = scalar_type(parameter.annotation)
    return found[2].index(value) if found and found[2] else value


def _as_argument(value: Any, port: PortType) -> Any:
    """An array as one piece of memory; one that is not there as an array of no size."""
    if port.kind != "array":
        return value
    if value is None:
        return np.empty((0,) * len(port.dims), port.dtype)
    return np.ascontiguousarray(value)


def _share(work: Callable[[int, int], object], ends: list[int]) -> None:
    """Call `work` with the first row and the end of each piece, in threads if it is many."""
    if len(ends) == 2:
        work(*ends)
        return
    pieces = iter([*pairwise(ends)])

    def take_pieces() -> None:
        for piece in pieces:
            work(*piece)

    threads = _threads(os.getpid())
    others = [threads.submit(take_pieces) for _ in range(1, os.cpu_count() or 1)]
    take_pieces()
    for other in others:
        other.result()


@cache
def _threads(process: int) -> ThreadPoolExecutor:
    """Threads beside the caller's, for all nodes of a process; one that is forked has none."""
    return ThreadPoolExecutor(max(1, (os.cpu_count() or 1) - 1))
