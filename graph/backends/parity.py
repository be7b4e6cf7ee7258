"""Parity: the generated proof that a node's implementations agree.

For every node with a kernel, the NumPy function is compared with the kernel over every shape, fill
and parameter setting below, within the node's own tolerance.  Outputs hold rubbish before the
launch; inputs must be unchanged after it.
"""

from __future__ import annotations

import typing
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import FunctionType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic.fields import FieldInfo

from tactograph.graph.backends.arrays import DeviceArray
from tactograph.graph.backends.device_backend import DeviceBackend, open_device
from tactograph.graph.declare.engine_arguments import EVERYTHING, Wanted
from tactograph.graph.declare.limits import bare_type, choices_of, limits_of
from tactograph.graph.declare.node import Node, Parameter
from tactograph.graph.declare.ports import PortType
from tactograph.graph.errors import InputError

CASE_SHAPES = ((1, 1), (3, 5), (31, 37), (64, 64), (70, 131))
"""H x W: one pixel, odd, prime, whole work-groups, larger than a work-group."""
CASE_FILLS = ("random", "zero", "low", "high", "edges", "nan")
INTEGER_FILLS: dict[str, tuple[type, int]] = {
    "8 bits": (np.uint8, 255),
    "16 bits": (np.uint16, 65535),
}
"""Fills for nodes whose kernels read a camera's integers."""
POISON_BYTE = 0xA5
MAX_DIFFERENCES = 5
"""Differences that a message lists."""


@dataclass(frozen=True)
class Case:
    """A comparison: `left_out` are absent inputs, `wanted` the outputs asked for."""

    sizes: Mapping[str, int]
    fill: str
    setting: str
    settings: Mapping[str, Any]
    left_out: tuple[str, ...] = ()
    wanted: tuple[str, ...] | None = None

    def __str__(self) -> str:
        sizes = "x".join(f"{name}{size}" for name, size in self.sizes.items())
        return f"{sizes}-{self.fill}-{self.setting}"


def cases(node: Node, shapes: tuple[tuple[int, int], ...] = CASE_SHAPES) -> list[Case]:
    """Make the cases of a node.

    They are every shape with every fill at default parameters, and, on one shape, every other
    setting, absent inputs, and parts of the outputs.
    """
    fills = [f for f in CASE_FILLS if f != "nan" or any(p.port.nan for p in node.inputs.values())]
    fills += [] if node.kernels.whole is None else list(INTEGER_FILLS)
    settings = dict(_settings(node))
    default = settings["default"]
    chosen = [
        Case(_sizes(node, shape, default), fill, "default", default)
        for shape in shapes
        for fill in fills
    ]
    middle = shapes[min(2, len(shapes) - 1)]
    chosen += [
        Case(_sizes(node, middle, setting), "random", name, setting)
        for name, setting in settings.items()
        if name != "default" and _fits(node, middle, setting)
    ]
    sizes = _sizes(node, middle, default)
    chosen += [
        Case(sizes, "random", f"without {' and '.join(names)}", default, left_out=names)
        for names in _absences(node)
    ]
    chosen += [
        Case(sizes, "random", f"only {' and '.join(names)}", default, wanted=names)
        for names in _demands(node)
    ]
    return chosen


def check(node: Node, device: str | None = None) -> int:
    """Compare a node's kernel with its NumPy function over all generated cases.

    For a test of one's own node: ``def test_brighten(): parity.check(brighten)``.

    Parameters
    ----------
    device
        A part of the name of the OpenCL device to use; the first that works if left out.

    Returns
    -------
    The number of cases.

    Raises
    ------
    AssertionError
        Naming the cases that differ, and how.
    InputError
        If the node has no kernel, or no device works.
    NodeError
        If the kernel does not match the declaration, or does not compile.
    """
    if not node.has_kernel:
        raise InputError(f"node '{node.name}' has no kernel to compare; declare it with .opencl")
    opencl, reason = open_device(["opencl"], device)
    if opencl is None:
        raise InputError(f"no kernel can be compared: {reason}")
    compared = cases(node)
    differences = [(case, compare(node, opencl, case)) for case in compared]
    wrong = [f"  {case}: {difference}" for case, difference in differences if difference]
    more = [f"  and {len(wrong) - MAX_DIFFERENCES} more"] if len(wrong) > MAX_DIFFERENCES else []
    said = f"node '{node.name}' differs on {opencl.name} in {len(wrong)} of {len(compared)} cases:"
    assert not wrong, "\n".join([said, *wrong[:MAX_DIFFERENCES], *more])
    return len(compared)


def _absences(node: Node) -> list[tuple[str, ...]]:
    """Inputs to leave out: each that may be absent, and all of them."""
    names = node.may_be_absent
    return [*((name,) for name in names), *([tuple(names)] if len(names) > 1 else [])]


def _demands(node: Node) -> list[tuple[str, ...]]:
    """Outputs to want: each alone, and all but each."""
    if node.wanted is None:
        return []
    names = tuple(node.outputs)
    others = [tuple(n for n in names if n != left) for left in names] if len(names) > 2 else []
    return [*((name,) for name in names), *others]


def compare(node: Node, device: DeviceBackend, case: Case) -> str | None:
    """Run one case on NumPy and on a device; return None, or what differs."""
    return compare_on(node, [device], case)


def compare_on(node: Node, devices: Iterable[DeviceBackend], case: Case) -> str | None:
    """Run a case on several devices, and on NumPy once; return the first difference."""
    inputs = make_inputs(node, case)
    kept = {name: np.copy(v) for name, v in inputs.items() if isinstance(v, np.ndarray)}
    wanted = EVERYTHING if case.wanted is None else Wanted(frozenset(case.wanted))
    keywords = {**case.settings, **({node.wanted: wanted} if node.wanted else {})}
    reference = by_port(node, node(*node.in_order(inputs), **keywords))
    changed = _changed(inputs, kept)
    if changed:
        return f"the NumPy function changed its input '{changed}'"
    for device in devices:
        poisoned, device.poison = device.poison, POISON_BYTE
        try:
            launch = _named(f"the kernel of {node.name}, case {case}")
            outputs, after = launch(node, device, case, inputs, wanted)
        finally:
            device.poison = poisoned
        changed = _changed(after, kept)
        if changed:
            return f"the kernel changed its input '{changed}'"
        wrong = _difference(node, reference, outputs, wanted)
        if wrong:
            return wrong
    return None


def _named(name: str) -> Callable[..., Any]:
    """`_on_device` under another name.

    A kernel that goes out of bounds may end the process.  Python's fault handler, which pytest
    turns on, then prints only the names of the running functions.
    """
    code = _on_device.__code__.replace(co_name=name, co_qualname=name)
    return FunctionType(code, globals())


def _difference(
    node: Node,
    reference: Mapping[str, NDArray[Any]],
    outputs: Mapping[str, NDArray[Any]],
    wanted: Wanted,
) -> str | None:
    for name, expected in reference.items():
        if name not in wanted:
            continue
        if expected.shape != outputs[name].shape:
            return f"{name}: shape {outputs[name].shape}, expected {expected.shape}"
        wrong = node.tolerance.difference(expected, outputs[name])
        if wrong:
            return f"{name}: {wrong}"
    return None


def _changed(inputs: Mapping[str, Any], before: Mapping[str, NDArray[Any]]) -> str | None:
    """Return the first input that has changed."""
    for name, array in before.items():
        equal_nan = array.dtype.kind == "f"
        if name in inputs and not np.array_equal(inputs[name], array, equal_nan=equal_nan):
            return name
    return None


def _on_device(
    node: Node, device: DeviceBackend, case: Case, inputs: Mapping[str, Any], wanted: Wanted
) -> tuple[dict[str, NDArray[Any]], dict[str, NDArray[Any]]]:
    """The outputs, and the inputs after the launch."""
    whole = node.kernels.whole if case.fill in INTEGER_FILLS else None
    if whole is not None:
        dtype, full = INTEGER_FILLS[case.fill]
        inputs = {**inputs, whole: np.rint(inputs[whole] * full).astype(dtype)}
    remote = {
        name: device.upload(value) if isinstance(value, np.ndarray) else value
        for name, value in inputs.items()
        if node.inputs[name].kind != "object"
    }
    sizes = _known_sizes(node, case)
    outputs, _ = device.prepare(node, case.settings, sizes, wanted).launch(remote)
    downloaded = {name: device.download(array) for name, array in outputs.items()}
    after = {n: device.download(a) for n, a in remote.items() if isinstance(a, DeviceArray)}
    if whole is not None:
        after[whole] = after[whole] / np.float32(full)
    return downloaded, after


def _known_sizes(node: Node, case: Case) -> dict[str, int]:
    """The sizes of the ports that are there."""
    there = [port for name, port in node.inputs.items() if name not in case.left_out]
    known = {dim for port in (*there, *node.outputs.values()) for dim in port.dims}
    return {symbol: size for symbol, size in case.sizes.items() if symbol in known}


def make_inputs(node: Node, case: Case) -> dict[str, Any]:
    """Inputs by port name, the same for the same case on every machine."""
    rng = np.random.default_rng(zlib.crc32(f"{node.name} {case}".encode()))
    made: dict[str, Any] = {}
    if node.make_example is not None:
        made = dict(node.make_example(rng, **case.sizes))
    for name, port in node.inputs.items():
        if name not in made and port.kind != "object":
            made[name] = _drawn(port, case, rng)
    return {name: value for name, value in made.items() if name not in case.left_out}


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
        full = INTEGER_FILLS[case.fill][1]
        array = rng.integers(0, full + 1, shape) / np.float32(full)
    elif whole:
        array = rng.integers(int(low), int(high) + 1, shape)
    else:
        array = rng.uniform(low, high, shape)
    if case.fill == "nan" and port.port.nan and not whole:
        array = np.where(rng.random(shape) < 0.2, np.nan, array)
    return np.ascontiguousarray(array.astype(port.dtype))


def by_port(node: Node, made: Any) -> dict[str, NDArray[Any]]:
    """A node's results by output."""
    return dict(zip(node.outputs, node.results(made), strict=True))


def _sizes(node: Node, shape: tuple[int, int], settings: Mapping[str, Any]) -> dict[str, int]:
    """H and W as given, four lights or as many as the node needs, the rest H times W.

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
    """Return whether a setting suits images of this shape: a window may be larger than they are."""
    try:
        _sizes(node, shape, setting)
    except InputError:
        return False
    return True


def _settings(node: Node) -> Iterator[tuple[str, dict[str, Any]]]:
    """Default parameters, then each at its lowest, highest, every choice and every example."""
    default = {name: _default(p) for name, p in node.parameters.items()}
    yield "default", default
    for name, parameter in node.parameters.items():
        for label, value in (*_extremes(parameter), *_examples(parameter)):
            yield f"{name}={label}", {**default, name: value}


def _default(parameter: Parameter) -> Any:
    return _bounds(parameter)[0] if parameter.required else parameter.default


def _extremes(parameter: Parameter) -> list[tuple[str, Any]]:
    base = bare_type(parameter.annotation)
    if base is bool:
        return [("false", False), ("true", True)]
    if choices := choices_of(base):
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
    limits = limits_of(parameter.annotation)
    low = limits.at_least if limits.above is None else limits.above + 1e-3
    high = limits.at_most if limits.below is None else limits.below - 1e-3
    middle = 1.0 if parameter.required else float(parameter.default)
    if low is None:
        low = middle - 10
    elif parameter.required and low > 0:
        low = max(low, 0.1)
    return low, max(10 * middle, low + 10) if high is None else high
