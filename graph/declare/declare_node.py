"""Make a `Node` of a function: read and check its signature."""

import collections.abc
import inspect
import typing
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

from tactograph.graph.declare.engine_arguments import NodeCall, Session, Wanted, Whole
from tactograph.graph.declare.node import Node
from tactograph.graph.declare.parameter import Parameter
from tactograph.graph.declare.ports import (
    ENGINE_INPUTS,
    NamedPorts,
    PortType,
    input_ports,
    is_record,
    read_port,
    record_fields,
    record_ports,
)
from tactograph.graph.declare.provenance import Provenance
from tactograph.graph.declare.size_rules import SizeLimit, SizeRule
from tactograph.graph.declare.tolerance import Tolerance

_ENGINE_ARGUMENTS = (
    ("provenance", Provenance), ("session", Session), ("wanted", Wanted), ("whole", Whole)
)  # fmt: skip
"""The arguments that the engine gives: the field of a node that names each, and its type."""


@typing.overload
def node(function: Callable[..., Any]) -> Node: ...


@typing.overload
def node(
    *,
    neutral: float | str = ...,
    tolerance: Tolerance = ...,
    sizes: Mapping[str, SizeLimit] = ...,
    derived: Mapping[str, SizeRule] = ...,
    endless: bool = ...,
) -> Callable[[Callable[..., Any]], Node]: ...


def node(
    function: Callable[..., Any] | None = None, **about: Any
) -> Node | Callable[[Callable[..., Any]], Node]:
    """Declare a function as a node.

    Parameters
    ----------
    neutral
        Replaces the node when a variant takes it out: a constant output, or the name of the
        input that is passed on.  None: the node cannot be taken out.
    tolerance
        The difference allowed between other back ends and NumPy, with the reason.
    sizes
        Limits on size symbols, each with the message for a size outside them.
    derived
        Size symbols that follow from others: ``{"h": SizeRule("H", by="factor")}``
        divides, or has a rule of its own.
    endless
        A source that yields until it is stopped, such as a camera, or as long as one ran: Ctrl-C
        is then a way to end a run, not an accident, and not every item is named.

    Raises
    ------
    TypeError
        If the signature is not a declaration: a port without a type, a parameter that is
        not keyword-only, a neutral input whose type is not the output's.
    """
    return partial(_declare, **about) if function is None else _declare(function, **about)


def _declare(function: Callable[..., Any], **about: Any) -> Node:
    """Read a function's signature."""
    hints = typing.get_type_hints(function, include_extras=True)
    inputs: dict[str, PortType] = {}
    records: dict[str, type] = {}
    optional: set[str] = set()
    repeated: PortType | None = None
    named: NamedPorts | None = None
    parameters: dict[str, Parameter] = {}
    parameter_records: dict[str, type] = {}
    by_engine: dict[str, Any] = {}
    calls: dict[str, Node] = {}
    for name, argument in _arguments(function, hints):
        annotation = hints.get(name)
        if annotation is None:
            raise TypeError(f"{function.__name__}: argument '{name}' has no type")
        if name in ENGINE_INPUTS:
            raise TypeError(f"{function.__name__}: every node has an input '{name}' already")
        if argument.kind is argument.KEYWORD_ONLY:
            if field := next((f for f, kind in _ENGINE_ARGUMENTS if annotation == kind), ""):
                by_engine[field] = name
            elif annotation is NodeCall:
                if not isinstance(argument.default, Node):
                    raise TypeError(
                        f"{function.__name__}: the default of '{name}' has to be a node"
                    )
                calls[name] = argument.default
            else:
                stated = [Parameter(name, annotation, argument.default)]
                if is_record(annotation):
                    parameter_records[name] = annotation
                    stated = _fields_as_parameters(annotation)
                for each in stated:
                    if each.name in parameters:
                        raise TypeError(
                            f"{function.__name__}: two parameters are called '{each.name}'"
                        )
                    parameters[each.name] = each
        elif argument.kind is argument.VAR_POSITIONAL:
            repeated = read_port(name, annotation)
        elif argument.kind is argument.VAR_KEYWORD:
            named = _named_ports(function.__name__, name, annotation)
        else:
            ports, record = input_ports(name, annotation)
            inputs |= ports
            records |= {name: record} if record else {}
            if argument.default is not argument.empty:
                optional.add(name)
    outputs, record, stream = _read_outputs(function.__name__, hints.get("return"))
    declared = Node(
        name=function.__name__,
        function=function,
        inputs=inputs,
        input_records=records,
        repeated=repeated,
        named=named,
        parameters=parameters,
        parameter_records=parameter_records,
        outputs=outputs,
        output_record=record,
        stream=stream,
        calls=calls,
        optional_inputs=frozenset(optional),
        kernel_package=_kernel_package(function.__module__),
        **by_engine,
        **about,
    )
    declared.__doc__ = function.__doc__
    _check_neutral(declared)
    _check_derived(declared)
    return declared


def _arguments(
    function: Callable[..., Any], hints: dict[str, Any]
) -> Iterator[tuple[str, inspect.Parameter]]:
    """A function's arguments; for ``*values: Unpack[Record]`` the record's fields, with `hints`."""
    for name, argument in inspect.signature(function).parameters.items():
        if typing.get_origin(hints.get(name)) is not typing.Unpack:
            yield name, argument
            continue
        (record,) = typing.get_args(hints[name])
        fields = record_fields(record)
        hints |= fields
        for field in fields:
            default = record._field_defaults.get(field, inspect.Parameter.empty)
            kind = inspect.Parameter.POSITIONAL_ONLY
            yield field, inspect.Parameter(field, kind, default=default)


def _named_ports(function: str, name: str, annotation: Any) -> NamedPorts:
    """The types of ``**name`` by the names of inputs."""
    for extra in typing.get_args(annotation):
        if isinstance(extra, NamedPorts):
            return extra
    raise TypeError(f"{function}: '**{name}' needs Annotated[..., NamedPorts(...)]")


def _fields_as_parameters(record: type) -> list[Parameter]:
    """The fields of a record of parameters."""
    defaults: Mapping[str, Any] = record._field_defaults  # type: ignore[attr-defined]
    return [
        Parameter(field, annotation, defaults.get(field, inspect.Parameter.empty))
        for field, annotation in record_fields(record).items()
    ]


def _kernel_package(module: str) -> str:
    """The package of a module's kernels: ``kernels/`` has the same rooms as ``nodes/``."""
    package, _, _ = module.rpartition(".")
    ring, separator, room = f"{package}.".partition(".nodes.")
    return f"{ring}.kernels.{room}".rstrip(".") if separator else package or module


def _read_outputs(name: str, annotation: Any) -> tuple[dict[str, PortType], type | None, bool]:
    if annotation is None or annotation is type(None):
        return {}, None, False
    stream = typing.get_origin(annotation) in (collections.abc.Iterator, collections.abc.Generator)
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
                f"{declared.name}: neutral '{neutral}' is not an input of the output's type"
            )


def _check_derived(declared: Node) -> None:
    for symbol, parts in declared.derived.items():
        named = {symbol, *parts.of.split()}
        if named - set(declared.symbols) or parts.by not in declared.parameters:
            raise TypeError(
                f"{declared.name}: size {symbol} = {parts} names no size or no parameter"
            )
