"""Make a function a `Node`: read and check its signature."""

import collections.abc
import inspect
import typing
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

from tactograph.graph.declare.engine_arguments import KeepIntegers, NodeCall, Session, Wanted
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
from tactograph.graph.declare.tolerance import Close

_ENGINE_ARGUMENTS = (
    ("provenance", Provenance), ("session", Session), ("wanted", Wanted), ("integers", KeepIntegers)
)  # fmt: skip
"""Arguments that the engine supplies: the `Node` field that names each, and its type."""


@typing.overload
def node(function: Callable[..., Any]) -> Node: ...


@typing.overload
def node(
    *,
    neutral: float | str = ...,
    tolerance: Close = ...,
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
        What replaces the node when a variant takes it out: a constant output, or the name of the
        input to pass on.  None: the node cannot be taken out.
    tolerance
        The difference allowed between other back ends and NumPy, with the reason.
    sizes
        Limits on size symbols, each with the message for a size outside the limits.
    derived
        Size symbols that follow from others: ``{"h": SizeRule("H", by="factor")}``
        divides, or has a rule of its own.
    endless
        Whether the source yields until it is stopped, as a camera does, or replays such a source.
        Ctrl-C then ends a run normally, and commands do not name every item.

    Raises
    ------
    TypeError
        If the signature is not a declaration: a port has no type, two parameters share a name, or
        the neutral input has another type than the output.
    """
    return partial(_declare, **about) if function is None else _declare(function, **about)


def _declare(function: Callable[..., Any], **about: Any) -> Node:
    hints = typing.get_type_hints(function, include_extras=True)
    name, package = function.__name__, _kernel_package(function.__module__)
    declared = Node(name, function, kernel_package=package, **about)
    declared.__doc__ = function.__doc__
    for argument in _arguments(function, hints):
        _add_argument(declared, argument, hints.get(argument.name))
    returned = _read_outputs(name, hints.get("return"))
    declared.outputs, declared.output_record, declared.stream = returned
    _check_neutral(declared)
    _check_derived(declared)
    return declared


def _add_argument(declared: Node, argument: inspect.Parameter, annotation: Any) -> None:
    """Sort in one argument by its meaning.  Raises TypeError if it declares nothing."""
    name = argument.name
    if annotation is None:
        raise TypeError(f"{declared.name}: argument '{name}' has no type")
    if name in ENGINE_INPUTS:
        raise TypeError(f"{declared.name}: every node has an input '{name}' already")
    if argument.kind is argument.KEYWORD_ONLY:
        _add_keyword(declared, argument, annotation)
    elif argument.kind is argument.VAR_POSITIONAL:
        declared.repeated = read_port(name, annotation)
    elif argument.kind is argument.VAR_KEYWORD:
        declared.named = _named_ports(declared.name, name, annotation)
    else:
        ports, record = input_ports(name, annotation)
        declared.inputs |= ports
        declared.input_records |= {name: record} if record else {}
        if argument.default is not argument.empty:
            declared.optional_inputs |= {name}


def _add_keyword(declared: Node, argument: inspect.Parameter, annotation: Any) -> None:
    name = argument.name
    if field := next((f for f, kind in _ENGINE_ARGUMENTS if annotation == kind), ""):
        setattr(declared, field, name)
    elif annotation is NodeCall:
        if not isinstance(argument.default, Node):
            raise TypeError(f"{declared.name}: the default of '{name}' has to be a node")
        declared.calls[name] = argument.default
    else:
        parameters = [Parameter(name, annotation, argument.default)]
        if is_record(annotation):
            declared.parameter_records[name] = annotation
            parameters = _fields_as_parameters(annotation)
        for each in parameters:
            if each.name in declared.parameters:
                raise TypeError(f"{declared.name}: two parameters are called '{each.name}'")
            declared.parameters[each.name] = each


def _arguments(function: Callable[..., Any], hints: dict[str, Any]) -> Iterator[inspect.Parameter]:
    """A function's arguments; ``*values: Unpack[Record]`` is replaced by the record's fields.

    The types of these fields are added to `hints`.
    """
    for name, argument in inspect.signature(function).parameters.items():
        if typing.get_origin(hints.get(name)) is not typing.Unpack:
            yield argument
            continue
        (record,) = typing.get_args(hints[name])
        fields = record_fields(record)
        hints |= fields
        for field in fields:
            default = record._field_defaults.get(field, inspect.Parameter.empty)
            kind = inspect.Parameter.POSITIONAL_ONLY
            yield inspect.Parameter(field, kind, default=default)


def _named_ports(function: str, name: str, annotation: Any) -> NamedPorts:
    """The `NamedPorts` that the annotation of ``**name`` carries."""
    for extra in typing.get_args(annotation):
        if isinstance(extra, NamedPorts):
            return extra
    raise TypeError(f"{function}: '**{name}' needs Annotated[..., NamedPorts(...)]")


def _fields_as_parameters(record: type) -> list[Parameter]:
    """One parameter for each field of a record."""
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
