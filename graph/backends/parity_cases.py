"""The cases in which implementations of a node are compared: shapes, fills, parameter extremes."""

import typing
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic.fields import FieldInfo

from tactograph.graph.declare.node import Node
from tactograph.graph.declare.parameter import Parameter
from tactograph.graph.declare.ports import PortType
from tactograph.graph.errors import InputError

CASE_SHAPES = ((1, 1), (3, 5), (31, 37), (64, 64), (70, 131))
"""H x W: one pixel, odd, prime, complete work-groups, larger than a work-group."""
CASE_FILLS = ("random", "zero", "low", "high", "edges", "nan")
INTEGER_FILLS: dict[str, type[np.integer[Any]]] = {"8 bits": np.uint8, "16 bits": np.uint16}
"""Fills for nodes whose kernels read a camera's integers."""


@dataclass(frozen=True)
class Case:
    """A comparison: `omitted` are absent inputs, `wanted` the outputs asked for."""

    sizes: Mapping[str, int]
    fill: str
    setting: str
    settings: Mapping[str, Any]
    omitted: tuple[str, ...] = ()
    wanted: tuple[str, ...] | None = None

    def __str__(self) -> str:
        sizes = "x".join(f"{name}{size}" for name, size in self.sizes.items())
        return f"{sizes}-{self.fill}-{self.setting}"


def cases(node: Node, shapes: tuple[tuple[int, int], ...] = CASE_SHAPES) -> list[Case]:
    """Make the cases of a node.

    They are every shape with every fill at default parameters, and, on one shape, every other
    setting, absent inputs, and parts of the outputs.
    """
    settings = dict(_settings(node))
    default = settings["default"]
    usual = product(shapes, _fills(node))
    chosen = [Case(_sizes(node, shape, default), fill, "default", default) for shape, fill in usual]
    middle = _middle(shapes)
    chosen += [
        Case(_sizes(node, middle, setting), "random", name, setting)
        for name, setting in settings.items()
        if name != "default" and _fits(node, middle, setting)
    ]
    sizes = _sizes(node, middle, default)
    for names in _absences(node):
        title = f"without {' and '.join(names)}"
        chosen.append(Case(sizes, "random", title, default, omitted=names))
    for names in _demands(node):
        title = f"only {' and '.join(names)}"
        chosen.append(Case(sizes, "random", title, default, wanted=names))
    return chosen


def make_inputs(node: Node, case: Case) -> dict[str, Any]:
    """Inputs by port name, the same for the same case on every machine."""
    rng = np.random.default_rng(zlib.crc32(f"{node.name} {case}".encode()))
    arrays: dict[str, Any] = {}
    if node.make_example is not None:
        for name, value in node.make_example(rng, **case.sizes).items():
            dtype = node.inputs[name].dtype
            arrays[name] = value if dtype is None else np.ascontiguousarray(value, dtype)
    for name, port in node.inputs.items():
        if name not in arrays and port.kind != "object":
            arrays[name] = _drawn(port, case, rng)
    return {name: value for name, value in arrays.items() if name not in case.omitted}


def _drawn(port: PortType, case: Case, rng: np.random.Generator) -> Any:
    low, high = port.port.low, port.port.high
    if port.kind == "number":
        return float(np.float32(rng.uniform(low, high)))
    assert port.dtype is not None
    shape = tuple(d if isinstance(d, int) else case.sizes[d] for d in port.dims)
    whole = port.dtype.kind in "ui"
    array: NDArray[Any]
    if case.fill == "zero":
        array = np.zeros(shape)
    elif case.fill in ("low", "high"):
        array = np.full(shape, low if case.fill == "low" else high)
    elif case.fill == "edges":
        array = rng.choice([low, high, (low + high) / 2, 0.0], shape)
    elif case.fill in INTEGER_FILLS and not whole:
        full = np.iinfo(INTEGER_FILLS[case.fill]).max
        array = rng.integers(0, full + 1, shape) / np.float32(full)
    elif whole:
        array = rng.integers(int(low), int(high) + 1, shape)
    else:
        array = rng.uniform(low, high, shape)
    if case.fill == "nan" and port.port.nan and not whole:
        array = np.where(rng.random(shape) < 0.2, np.nan, array)
    return np.ascontiguousarray(array.astype(port.dtype))


def _fills(node: Node) -> list[str]:
    fills = [f for f in CASE_FILLS if f != "nan" or any(p.port.nan for p in node.inputs.values())]
    return fills if node.kernels.integers is None else [*fills, *INTEGER_FILLS]


def _middle(shapes: tuple[tuple[int, int], ...]) -> tuple[int, int]:
    """The shape for cases that do not vary the shape."""
    return shapes[min(2, len(shapes) - 1)]


def _absences(node: Node) -> list[tuple[str, ...]]:
    """Inputs to leave out: each that may be absent, and all of them."""
    names = node.may_be_absent
    return [*((name,) for name in names), *([tuple(names)] if len(names) > 1 else [])]


def _demands(node: Node) -> list[tuple[str, ...]]:
    """Outputs to want: each alone, and all but each."""
    if node.wanted is None:
        return []
    names = tuple(node.outputs)
    others = [tuple(n for n in names if n != one) for one in names] if len(names) > 2 else []
    return [*((name,) for name in names), *others]


def _sizes(node: Node, shape: tuple[int, int], settings: Mapping[str, Any]) -> dict[str, int]:
    """The sizes of a case: H and W as given, four lights (or as many as the node needs), else H W.

    A part h x w of an image may be as large as the image.  Derived sizes follow from the node's
    rules.
    """
    sizes: dict[str, int] = {}
    for symbol in node.symbols:
        limit = node.sizes.get(symbol)
        if symbol.upper() in ("H", "W"):
            sizes[symbol] = shape["HW".index(symbol.upper())]
        elif symbol == "K":
            sizes[symbol] = max(4, limit.low if limit else 0)
        else:
            sizes[symbol] = shape[0] * shape[1]
    for symbol, parts in node.derived.items():
        sizes[symbol] = parts.size(sizes, settings)
    return sizes


def _fits(node: Node, shape: tuple[int, int], setting: dict[str, Any]) -> bool:
    """Return whether a setting suits images of this shape; a window may be too large for them."""
    try:
        _sizes(node, shape, setting)
    except InputError:
        return False
    return True


def _levels(node: Node) -> dict[str, list[tuple[str, Any]]]:
    """The default, the extremes, every choice and every example of each parameter, with names."""
    return {
        name: [("default", _default(p)), *_extremes(p), *_examples(p)]
        for name, p in node.parameters.items()
    }


def _settings(node: Node) -> Iterator[tuple[str, dict[str, Any]]]:
    """Default parameters, then each at its other levels."""
    levels = _levels(node)
    default = {name: values[0][1] for name, values in levels.items()}
    yield "default", default
    for name, values in levels.items():
        for label, value in values[1:]:
            yield f"{name}={label}", {**default, name: value}


def _default(parameter: Parameter) -> Any:
    return _bounds(parameter)[0] if parameter.required else parameter.default


def _extremes(parameter: Parameter) -> list[tuple[str, Any]]:
    base = parameter.type
    if base is bool:
        return [("false", False), ("true", True)]
    if choices := parameter.choices:
        return [(str(choice), choice) for choice in choices]
    if base in (int, float):
        low, high = _bounds(parameter)
        return [("lowest", base(low)), ("highest", base(high))]
    return []


def _examples(parameter: Parameter) -> list[tuple[str, Any]]:
    """The values that a parameter's ``Field(examples=[...])`` states."""
    marks = typing.get_args(parameter.annotation)[1:]
    stated = [mark.examples or [] for mark in marks if isinstance(mark, FieldInfo)]
    return [(str(value), value) for values in stated for value in values]


def _bounds(parameter: Parameter) -> tuple[float, float]:
    """The range of a parameter; where it is open, a decade around 1 or its default."""
    limits = parameter.limits
    low = limits.at_least if limits.above is None else limits.above + 1e-3
    high = limits.at_most if limits.below is None else limits.below - 1e-3
    default = parameter.default
    middle = float(default) if isinstance(default, int | float) else 1.0
    if low is None:
        low = middle - 10
    elif parameter.required and low > 0:
        low = max(low, 0.1)
    return low, max(10 * middle, low + 10) if high is None else high
