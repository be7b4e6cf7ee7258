"""Nodes: a function's signature is its declaration.

Positional arguments are input ports, keyword-only arguments are parameters, and the return
annotation gives the output port, or a record of ports.  A `NamedTuple` as an input takes all
outputs of one node; as a parameter it stands for its fields.  ``*values: Unpack[Record]`` makes
each field of the record an input.  ``*arguments`` takes any number of inputs, which a graph names
freely.  ``**arguments`` takes optional inputs whose types follow from their names (`NamedPorts`).
A function that returns an iterator is a source of a stream; one that returns None is a sink.  The
NumPy body is the reference; `Node.opencl` declares that ``kernels/ROOM/NAME.cl`` is the same
algorithm.
"""

from __future__ import annotations

import inspect
import itertools
import os
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, update_wrapper
from typing import TYPE_CHECKING, Any

from tactograph.graph.declare.kernel_declaration import (
    CanRun,
    Kernels,
    Lanes,
    LaunchFunction,
    can_run_anywhere,
)
from tactograph.graph.declare.parameter import Parameter
from tactograph.graph.declare.ports import (
    NamedPorts,
    PortType,
    input_ports,
    make_record,
    record_ports,
    record_values,
)
from tactograph.graph.declare.size_rules import SizeLimit, SizeRule
from tactograph.graph.declare.tolerance import Close

if TYPE_CHECKING:
    from tactograph.graph.declare.description import Description


@dataclass(eq=False)
class Node:
    """The declaration of a node, callable as the plain NumPy function it wraps."""

    name: str
    function: Callable[..., Any]
    inputs: dict[str, PortType] = field(default_factory=dict)
    input_records: dict[str, type] = field(default_factory=dict)
    repeated: PortType | None = None
    parameters: dict[str, Parameter] = field(default_factory=dict)
    parameter_records: dict[str, type] = field(default_factory=dict)
    outputs: dict[str, PortType] = field(default_factory=dict)
    output_record: type | None = None
    stream: bool = False
    named: NamedPorts | None = None
    neutral: float | str | None = None
    tolerance: Close = field(default_factory=Close)
    sizes: Mapping[str, SizeLimit] = field(default_factory=dict)
    derived: Mapping[str, SizeRule] = field(default_factory=dict)
    package: str = "tactograph"
    provenance: str | None = None
    session: str | None = None
    wanted: str | None = None
    integers: str | None = None
    calls: dict[str, Node] = field(default_factory=dict)
    endless: bool = False
    ahead: bool = False
    opencl_kernels: Kernels | None = None
    make_example: Callable[..., dict[str, Any]] | None = None
    make_rehearsal: Callable[..., Any] | None = None
    check_handed_in: Callable[[Any, str], None] | None = None
    is_idle: Callable[..., bool] | None = None
    kernel_package: str = "tactograph.kernels"
    optional_inputs: frozenset[str] = field(default_factory=frozenset)
    serial: int = field(default_factory=itertools.count(1).__next__, init=False)
    """A number that is unique to this declaration within the process."""
    _sized: dict[tuple[str, ...], Node] = field(default_factory=dict, init=False)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        for name, record in self.parameter_records.items():
            fields = {field: kwargs.pop(field) for field in record._fields if field in kwargs}  # type: ignore[attr-defined]
            kwargs[name] = kwargs[name]._replace(**fields) if name in kwargs else record(**fields)
        return self.function(*args, **kwargs)

    def with_inputs(self, names: Iterable[str]) -> Node:
        """This node with the inputs that a graph names, if it takes inputs of any name."""
        key = tuple(names)
        if self.repeated is None:
            further = {*self.further_names} - {*self.input_names}
            key = tuple(name for name in key if name in further)
        if key and key not in self._sized:
            if self.named:
                self._sized[key] = self._with_named(self.named, key)
            elif self.repeated:
                inputs = {name: replace(self.repeated, name=name) for name in key}
                self._sized[key] = replace(self, inputs=inputs, repeated=None)
        return self._sized[key] if key else self

    def _with_named(self, named: NamedPorts, names: tuple[str, ...]) -> Node:
        """This node with these inputs, which its function takes as ``**arguments``."""
        inputs, records, count = {**self.inputs}, {**self.input_records}, len(self._arguments)
        for name in names:
            ports, record = input_ports(name, named.annotation(name) | None)
            inputs |= ports
            records |= {name: record} if record else {}

        def function(*arguments: Any, **settings: Any) -> Any:
            by_name = dict(zip(names, arguments[count:], strict=False))
            return self.function(*arguments[:count], **by_name, **settings)

        return replace(
            self,
            function=update_wrapper(function, self.function),
            inputs=inputs,
            input_records=records,
            optional_inputs=self.optional_inputs | {*names},
        )

    @cached_property
    def about(self) -> Description:
        """The parsed docstring."""
        from tactograph.graph.declare.description import Description

        names = [*self.input_names, *self.parameters]
        names += [self.repeated.name] if self.repeated else []
        quantities = {name: port.meaning for name, port in self.inputs.items()}
        return Description.of(self.doc or "", names, quantities, self.parameter_records.values())

    @property
    def input_names(self) -> list[str]:
        """The names that ``in`` of a graph file may use: records, then single ports.

        With `repeated` it may use any other names, too.
        """
        return [*self.input_records, *(name for name in self.inputs if "." not in name)]

    @property
    def further_names(self) -> list[str]:
        """The further optional inputs that a graph may name."""
        return [*self.named.names()] if self.named else []

    @property
    def source(self) -> bool:
        return not self.inputs and self.repeated is None

    @property
    def sink(self) -> bool:
        return not self.outputs

    @property
    def may_be_handed_in(self) -> bool:
        """Return whether it is a source that a caller's array can stand in for."""
        ports = [*self.outputs.values()]
        is_array = self.source and len(ports) == 1 and ports[0].kind == "array"
        return self.stream or is_array

    @property
    def doc(self) -> str:
        return inspect.getdoc(self.function) or ""

    @property
    def summary(self) -> str:
        return self.doc.partition("\n\n")[0].replace("\n", " ")

    @property
    def has_kernel(self) -> bool:
        return self.opencl_kernels is not None

    @property
    def kernels(self) -> Kernels:
        """The OpenCL implementation of a node that has one."""
        assert self.opencl_kernels is not None
        return self.opencl_kernels

    def reads_integers(self, name: str) -> bool:
        """Return whether the kernel reads an input's images as the camera's integers."""
        return self.has_kernel and self.kernels.integers == name

    def in_order(self, inputs: Mapping[str, Any]) -> list[Any]:
        """Turn inputs by port into positional arguments: records assembled, None if absent."""
        return [
            self._record(name, [inputs.get(port) for port in ports])
            if name in self.input_records
            else inputs.get(name)
            for name, ports in self._arguments.items()
        ]

    @cached_property
    def _arguments(self) -> dict[str, list[str]]:
        """The ports of each positional argument: several if it is a record."""
        arguments: dict[str, list[str]] = {}
        for port in self.inputs:
            arguments.setdefault(port.partition(".")[0], []).append(port)
        return arguments

    def by_port(self, arguments: Iterable[Any]) -> dict[str, Any]:
        """Turn positional arguments into values by port: the inverse of `in_order`."""
        values: list[Any] = []
        for name, value in zip(self._arguments, arguments, strict=False):
            record = self.input_records.get(name)
            if record is None:
                values.append(value)
            elif value is None:
                values += [None] * len(record_ports(record))
            else:
                values += record_values(record, value)
        return dict(zip(self.inputs, values, strict=False))

    def _record(self, name: str, values: Sequence[Any]) -> Any:
        if name in self.optional_inputs and all(value is None for value in values):
            return None
        return make_record(self.input_records[name], values)

    def results(self, result: Any) -> tuple[Any, ...]:
        """The values that the function returned or yielded, in the order of the outputs."""
        if self.sink:
            return ()
        record = self.output_record
        return (result,) if record is None else record_values(record, result)

    def name_of(self, result: Any) -> str:
        """The text ``name`` among the values that the function yielded; "" if there is none."""
        name = dict(zip(self.outputs, self.results(result), strict=True)).get("name")
        return name if isinstance(name, str) else ""

    def output_shape(self, port: str, sizes: Mapping[str, int]) -> tuple[int, ...]:
        """The shape of an output.  Raises KeyError with the symbol whose size is not known."""
        return tuple(d if isinstance(d, int) else sizes[d] for d in self.outputs[port].dims)

    @cached_property
    def symbols(self) -> tuple[str, ...]:
        """The size symbols in the order in which they first appear: the kernel's order."""
        symbols: dict[str, None] = {}
        for port in (*self.inputs.values(), *self.outputs.values()):
            symbols.update(dict.fromkeys(d for d in port.dims if isinstance(d, str)))
        return tuple(symbols)

    @cached_property
    def free_symbols(self) -> tuple[str, ...]:
        """The size symbols that neither an input nor a `derived` rule gives."""
        dims = {dim for port in self.inputs.values() for dim in port.dims} | {*self.derived}
        return tuple(symbol for symbol in self.symbols if symbol not in dims)

    @cached_property
    def finds_sizes(self) -> bool:
        """Return whether the size of an output depends on the data.

        The host then waits for the device in the middle of the launch.
        """
        return not self.source and bool(self.free_symbols)

    @property
    def may_be_absent(self) -> list[str]:
        """The inputs, by port, that may be absent from an item."""
        ports = self.inputs.values()
        return [p.name for p in ports if p.optional or p.name in self.optional_inputs]

    def may_lack(self, symbol: str) -> bool:
        """Return whether only optional inputs give a size; if all are absent a kernel gets 0."""
        absent = self.may_be_absent
        needed = [p for p in self.inputs.values() if p.name not in absent]
        return all(symbol not in port.dims for port in (*needed, *self.outputs.values()))

    @typing.overload
    def opencl(
        self,
        *,
        grid: str,
        lanes: Lanes | None = None,
        integers: str | None = None,
        source: str | os.PathLike[str] | None = None,
    ) -> Node: ...

    @typing.overload
    def opencl(
        self, *, can_run: CanRun = can_run_anywhere, source: str | os.PathLike[str] | None = None
    ) -> Callable[[LaunchFunction], LaunchFunction]: ...

    def opencl(
        self, *, grid: str | None = None, **how: Any
    ) -> Node | Callable[[LaunchFunction], LaunchFunction]:
        """Declare the OpenCL implementation in ``kernels/ROOM/NAME.cl``.

        Parameters
        ----------
        grid
            The size symbols of the grid of work-items, slowest first.  The engine then
            launches the kernel of the node's own name.  Without it the call decorates a
            function that takes a `Launch`, for nodes of several launches.
        lanes
            "grid" if a work-item computes LANES consecutive elements of the flattened grid: 16 on
            CPUs, 1 elsewhere; see ``lanes.clh``.  "rows" if it stays within a row of the grid's
            last axis.
        integers
            An input of images that the kernel reads either as fractions of full scale or as the
            camera's unsigned integers; see ``pixels.clh``.
        can_run
            Takes a device's traits and returns None, or an `Obstacle`: what the launch function
            lacks there, or why the NumPy function is faster.
        source
            The kernels' text or path, for a node that a script or notebook defines.
        """
        if grid is not None:
            self.opencl_kernels = Kernels(tuple(grid.split()), **how)
            return self

        def take(launch: LaunchFunction) -> LaunchFunction:
            self.opencl_kernels = Kernels(launch=launch, **how)
            return launch

        return take

    def example(self, function: Callable[..., dict[str, Any]]) -> Callable[..., dict[str, Any]]:
        """Register a function that makes test inputs, for nodes whose inputs depend on one another.

        It is called as ``f(rng, **sizes)`` and returns inputs by port name, whose arrays are
        converted to the ports' element types.  All further inputs are drawn from their ports'
        ranges.
        """
        self.make_example = function
        return function

    def idle(self, function: Callable[..., bool]) -> Callable[..., bool]:
        """Register a predicate that is true when the node is a no-op.

        The node then returns its neutral input, or the inputs that its outputs are named after, or
        no output if that may be absent; a device launches nothing.  The predicate is called with
        the inputs that its arguments name; a field of a record is ``film_albedo``, as in a kernel.
        An argument with a default names an array that has to be absent.
        """
        handed_on = [self.inputs.get(self.handed_on(name)) for name in self.outputs]
        if None in handed_on and not all(p.optional for p in self.outputs.values()):
            raise TypeError(
                f"{self.name}: only a node whose neutral is an input, whose outputs are called "
                "like inputs, or whose output may be absent, can be idle"
            )
        self.is_idle = function
        return function

    def handed_on(self, output: str) -> str:
        """The input that an idle node returns as this output."""
        return self.neutral if isinstance(self.neutral, str) else output

    def reads_ahead(self) -> None:
        """Let a thread read the next item while the last one is in use; each has its own memory."""
        self.ahead = True

    def rehearsal(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Register a function that makes a dummy item, for a source that cannot wait.

        The graph runs on it once, without sinks, before the source starts: kernels are compiled
        before a camera opens.  The function is called with the node's settings, and with the
        node's argument of type `KeepIntegers` if it has one.
        """
        self.make_rehearsal = function
        return function

    def handed_in(self, check: Callable[[Any, str], None]) -> Callable[[Any, str], None]:
        """Register a check of the array that a caller hands in for an item of this source.

        It is called with an array of the first output's shape and the source's name in the graph.
        It raises `InputError`, or calls `warn`.
        """
        self.check_handed_in = check
        return check
