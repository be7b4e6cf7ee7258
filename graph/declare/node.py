"""Nodes: a function's signature is its declaration.

Positional arguments are input ports, keyword-only arguments are parameters, the return
annotation gives the output port, or a record of ports.  A function that returns an iterator
is a source of a stream; one that returns None is a sink.  The NumPy body is the reference;
`Node.opencl` declares that ``kernels/<name>.cl`` holds the same algorithm.
"""

from __future__ import annotations

import collections.abc
import inspect
import itertools
import os
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from tactograph.graph.backends.kernels import Kernels, Lanes, LaunchFunction
from tactograph.graph.declare.ports import PortType, is_record, read_port, record_ports
from tactograph.graph.declare.provenance import Provenance
from tactograph.graph.declare.session import Session
from tactograph.graph.declare.tolerance import Exact, Tolerance
from tactograph.graph.declare.wanted_outputs import Wanted


@dataclass(frozen=True)
class SizeLimit:
    """The sizes a node accepts for one symbol, and why not others."""

    low: int
    high: int | None
    why: str

    def refuses(self, size: int) -> bool:
        return size < self.low or (self.high is not None and size > self.high)


@dataclass(frozen=True)
class Parts:
    """A size that follows from another: that one divided by a parameter, rounded up."""

    of: str
    by: str

    def size(self, whole: int, settings: Mapping[str, Any]) -> int:
        return -(-whole // int(settings[self.by]))


@dataclass(frozen=True)
class Parameter:
    """A keyword-only argument: a setting in the graph file."""

    name: str
    annotation: Any
    default: Any = inspect.Parameter.empty

    @property
    def required(self) -> bool:
        return self.default is inspect.Parameter.empty


_serials = itertools.count(1)


@dataclass
class Node:
    """The declaration of a node, callable as the plain NumPy function it wraps."""

    name: str
    function: Callable[..., Any]
    inputs: dict[str, PortType]
    input_records: dict[str, type]
    parameters: dict[str, Parameter]
    outputs: dict[str, PortType]
    output_record: type | None
    stream: bool
    neutral: float | str | None
    tolerance: Tolerance
    sizes: Mapping[str, SizeLimit]
    derived: Mapping[str, Parts]
    package: str = "tactograph"
    provenance: str | None = None
    session: str | None = None
    wanted: str | None = None
    endless: bool = False
    implementations: dict[str, Kernels] = field(default_factory=dict)
    make_example: Callable[..., dict[str, Any]] | None = None
    kernel_package: str = "tactograph.kernels"
    optional_inputs: frozenset[str] = field(default_factory=frozenset)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self.function(*args, **kwargs)

    @cached_property
    def serial(self) -> int:
        """A number that no other declaration in this process has."""
        return next(_serials)

    @property
    def input_names(self) -> list[str]:
        """What ``in`` of a graph file may name: records as a whole, then ports."""
        return [*self.input_records, *(name for name in self.inputs if "." not in name)]

    @property
    def source(self) -> bool:
        return not self.inputs

    @property
    def sink(self) -> bool:
        return not self.outputs

    @property
    def doc(self) -> str:
        return inspect.getdoc(self.function) or ""

    @property
    def summary(self) -> str:
        return self.doc.partition("\n\n")[0].replace("\n", " ")

    @property
    def has_kernel(self) -> bool:
        return "opencl" in self.implementations

    @property
    def kernels(self) -> Kernels:
        """Its OpenCL implementation; a KeyError where there is none."""
        return self.implementations["opencl"]

    @property
    def backends(self) -> frozenset[str]:
        """The back ends that it is written for."""
        return frozenset({"numpy", *self.implementations})

    def in_order(self, inputs: Mapping[str, Any]) -> list[Any]:
        """Inputs by port as positional arguments, records put together; None for those left out."""
        if not self.input_records:
            return [inputs.get(name) for name in self.inputs]
        arguments: dict[str, Any] = {}
        for name in self.inputs:
            record, dot, member = name.partition(".")
            if dot:
                arguments.setdefault(record, {})[member] = inputs.get(name)
            else:
                arguments[name] = inputs.get(name)
        return [
            self.input_records[name](**found) if name in self.input_records else found
            for name, found in arguments.items()
        ]

    def output_shape(self, port: str, sizes: Mapping[str, int]) -> tuple[int, ...]:
        """The shape of an output whose symbols are all known; a KeyError names one that is not."""
        return tuple(d if isinstance(d, int) else sizes[d] for d in self.outputs[port].dims)

    @cached_property
    def symbols(self) -> tuple[str, ...]:
        """The size symbols in the order in which they first appear: the kernel's order."""
        seen: dict[str, None] = {}
        for port in (*self.inputs.values(), *self.outputs.values()):
            seen.update(dict.fromkeys(d for d in port.dims if isinstance(d, str)))
        return tuple(seen)

    @property
    def may_be_absent(self) -> list[str]:
        """The inputs, by port, that an item may come without."""
        ports = self.inputs.values()
        return [p.name for p in ports if p.optional or p.name in self.optional_inputs]

    def may_lack(self, symbol: str) -> bool:
        """Whether a size is one of absent inputs alone: 0 for a kernel then."""
        absent = self.may_be_absent
        needed = [p for p in self.inputs.values() if p.name not in absent]
        return all(symbol not in port.dims for port in (*needed, *self.outputs.values()))

    @typing.overload
    def opencl(
        self,
        *,
        grid: str,
        lanes: Lanes | bool = False,
        row_lanes: bool = False,
        whole: str | None = None,
        source: str | os.PathLike[str] | None = None,
    ) -> Node: ...

    @typing.overload
    def opencl(
        self,
        *,
        requires: tuple[str, str] | None = None,
        own_lanes: bool = False,
        on_cpu: str | None = None,
        source: str | os.PathLike[str] | None = None,
    ) -> Callable[[LaunchFunction], LaunchFunction]: ...

    def opencl(
        self,
        *,
        grid: str | None = None,
        lanes: Lanes | bool = False,
        row_lanes: bool = False,
        whole: str | None = None,
        requires: tuple[str, str] | None = None,
        own_lanes: bool = False,
        on_cpu: str | None = None,
        source: str | os.PathLike[str] | None = None,
    ) -> Node | Callable[[LaunchFunction], LaunchFunction]:
        """Declare the OpenCL implementation in ``kernels/<name>.cl``.

        Parameters
        ----------
        grid
            The size symbols that one work-item each is started for, slowest first.  The
            engine then launches the kernel of the node's own name.  Without it the call is
            a decorator for a function that is handed a `Launch`, for nodes of several
            launches.
        lanes
            "grid" if a work-item does LANES consecutive elements of the grid, which is then
            counted through as one axis: 16 on CPUs, 1 elsewhere; see ``lanes.clh``.  "rows"
            if none goes on into the next row of the grid's last axis.  True is "grid".
        row_lanes
            True is ``lanes="rows"``.
        whole
            An input, images as fractions of full scale, that the kernel also reads as the
            unsigned integers which they were; see ``pixels.clh``.
        requires
            A module that the launch function needs, and what to install to get it.
        own_lanes
            Whether it does without that module on devices that do several lanes.
        on_cpu
            Why the NumPy function is the better one if the device is a CPU: it is then
            taken wherever numpy is among the graph's preferences.
        source
            The kernels themselves, as text or as a path, for a node of a script or notebook.
        """
        along: Lanes | None = "rows" if row_lanes else "grid" if lanes is True else lanes or None
        if grid is not None:
            self.implementations["opencl"] = Kernels(
                tuple(grid.split()), along, whole, source=source
            )
            return self
        kernels = Kernels(requires=requires, own_lanes=own_lanes, on_cpu=on_cpu, source=source)

        def take(launch: LaunchFunction) -> LaunchFunction:
            self.implementations["opencl"] = replace(kernels, launch=launch)
            return launch

        return take

    def example(self, function: Callable[..., dict[str, Any]]) -> Callable[..., dict[str, Any]]:
        """Register a maker of test inputs, for nodes whose inputs depend on one another.

        It is called as ``f(rng, **sizes)`` and returns inputs by port name;
        what it leaves out is drawn from the port's own range.
        """
        self.make_example = function
        return function


@typing.overload
def node(function: Callable[..., Any]) -> Node: ...


@typing.overload
def node(
    *,
    neutral: float | str | None = None,
    tolerance: Tolerance | None = None,
    sizes: Mapping[str, SizeLimit] | None = None,
    derived: Mapping[str, Parts] | None = None,
    endless: bool = False,
) -> Callable[[Callable[..., Any]], Node]: ...


def node(
    function: Callable[..., Any] | None = None,
    *,
    neutral: float | str | None = None,
    tolerance: Tolerance | None = None,
    sizes: Mapping[str, SizeLimit] | None = None,
    derived: Mapping[str, Parts] | None = None,
    endless: bool = False,
) -> Node | Callable[[Callable[..., Any]], Node]:
    """Declare a function as a node.

    Parameters
    ----------
    neutral
        What stands in when a variant takes the node out: a constant for the output, or the
        name of the input that is passed on.  None: the node cannot be taken out.
    tolerance
        How far other back ends' output may differ from the NumPy one, and why.
    sizes
        Limits on size symbols, with the sentence a user reads when they are not met.
    derived
        Size symbols that follow from others: ``{"h": Parts("H", by="factor")}``.
    endless
        A source that yields until it is stopped, such as a camera: Ctrl-C is then the way
        to end a run, not an accident.

    Raises
    ------
    TypeError
        If the signature is not a declaration: a port without a type, a parameter that is
        not keyword-only, a neutral input whose type is not the output's.
    """
    if function is None:
        return lambda f: _declare(f, neutral, tolerance, sizes or {}, derived or {}, endless)
    return _declare(function, neutral, tolerance, sizes or {}, derived or {}, endless)


def _declare(
    function: Callable[..., Any],
    neutral: float | str | None,
    tolerance: Tolerance | None,
    sizes: Mapping[str, SizeLimit],
    derived: Mapping[str, Parts],
    endless: bool,
) -> Node:
    """Read a function's signature."""
    hints = typing.get_type_hints(function, include_extras=True)
    inputs: dict[str, PortType] = {}
    records: dict[str, type] = {}
    optional: set[str] = set()
    parameters: dict[str, Parameter] = {}
    provenance: str | None = None
    session: str | None = None
    wanted: str | None = None
    for name, argument in inspect.signature(function).parameters.items():
        annotation = hints.get(name)
        if annotation is None:
            raise TypeError(f"{function.__name__}: argument '{name}' has no type")
        if argument.kind is argument.KEYWORD_ONLY:
            if annotation is Provenance:
                provenance = name
            elif annotation is Session:
                session = name
            elif annotation is Wanted:
                wanted = name
            else:
                parameters[name] = Parameter(name, annotation, argument.default)
        elif is_record(annotation):
            records[name] = annotation
            ports = record_ports(annotation, f"{name}.")
            inputs.update({port.name: port for port in ports.values()})
        else:
            inputs[name] = read_port(name, annotation)
            if argument.default is not argument.empty:
                optional.add(name)
    outputs, record, stream = _read_outputs(function.__name__, hints.get("return"))
    declared = Node(
        name=function.__name__,
        function=function,
        inputs=inputs,
        input_records=records,
        parameters=parameters,
        outputs=outputs,
        output_record=record,
        stream=stream,
        neutral=neutral,
        tolerance=tolerance or Exact(),
        sizes=sizes,
        derived=derived,
        provenance=provenance,
        session=session,
        wanted=wanted,
        endless=endless,
        optional_inputs=frozenset(optional),
        kernel_package=_kernel_package(function.__module__),
    )
    declared.__doc__ = function.__doc__
    _check_neutral(declared)
    _check_derived(declared)
    return declared


def _kernel_package(module: str) -> str:
    """Where the kernels of a module's node lie: ``kernels/`` has the same rooms as ``nodes/``."""
    package, _, _ = module.rpartition(".")
    room = package.removeprefix("tactograph.nodes")
    return f"tactograph.kernels{room}" if room != package else package or module


def _read_outputs(name: str, annotation: Any) -> tuple[dict[str, PortType], type | None, bool]:
    if annotation is None or annotation is type(None):
        return {}, None, False
    stream = typing.get_origin(annotation) in (
        collections.abc.Iterator,
        collections.abc.Generator,
    )
    if stream:
        annotation = typing.get_args(annotation)[0]
    if is_record(annotation):
        return record_ports(annotation), annotation, stream
    return {name: read_port(name, annotation)}, None, stream


def _check_neutral(declared: Node) -> None:
    neutral = declared.neutral
    if neutral is None:
        return
    if len(declared.outputs) != 1:
        raise TypeError(f"{declared.name}: only a node with one output can have a neutral")
    if isinstance(neutral, str):
        output = next(iter(declared.outputs.values()))
        port = declared.inputs.get(neutral)
        if port is None or (port.dims, port.dtype) != (output.dims, output.dtype):
            raise TypeError(
                f"{declared.name}: neutral '{neutral}' is no input of the output's type"
            )


def _check_derived(declared: Node) -> None:
    for symbol, parts in declared.derived.items():
        if {symbol, parts.of} - set(declared.symbols) or parts.by not in declared.parameters:
            raise TypeError(
                f"{declared.name}: size {symbol} = {parts.of} / {parts.by} names no size or "
                "no parameter"
            )
