"""Ports: the ends of the graph's edges, and the types of the values on them.

A port is declared by an annotation.  ``Annotated[NDArray[np.float32], Port("K H W")]``
is an array port; ``Annotated[float, Port(unit="mm/px")]`` is a number; any other plain
type (``str``, ``dict[str, float]``) is an object that stays on the host.  A string among the
metadata is the value's meaning.  ``X | None`` makes the port optional.  A ``NamedTuple`` of
ports is a record: one edge, several values.  The ports of a nested record belong to the outer one.
A node that lacks optional fields of a record can still be read as that record.
"""

import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import islice
from typing import Annotated, Any, Literal

import numpy as np

from tactograph.graph.declare.annotations import members_of

Dim = str | int
IMAGE_SIZES = {"K": "lights", "H": "rows of pixels", "W": "columns of pixels"}
"""What the sizes of a stack of images count, for messages."""

CONDITION_INPUT = "when"
"""The input that every node takes in addition: the node runs if its value is not zero."""
RESTING_INPUT = "else"
"""The input that names the node whose values replace this node's if it does not run."""
ENGINE_INPUTS = frozenset({CONDITION_INPUT, RESTING_INPUT})


@dataclass(frozen=True)
class Port:
    """The metadata of an array or number port.

    Parameters
    ----------
    dims
        Sizes separated by blanks: symbols (``K H W``) bind across the graph, numbers are
        fixed.  Empty for a number.
    unit
        Physical unit; two connected ports must state the same one.  "1" is dimensionless.
    nan
        Whether NaN is a legal value ("not known here").
    low, high
        The values a test may draw from; not enforced at run time.
    """

    dims: str = ""
    unit: str = "1"
    nan: bool = False
    low: float = 0.0
    high: float = 1.0


@dataclass(frozen=True)
class NamedPorts:
    """The metadata of ``**arguments``: optional inputs whose types follow from their names.

    Parameters
    ----------
    names
        Return the names that a graph may use.
    annotation
        Return the annotation of the input of such a name.
    """

    names: Callable[[], Iterable[str]]
    annotation: Callable[[str], Any]


@dataclass(frozen=True)
class PortType:
    """A port as the engine sees it, read from an annotation."""

    name: str
    kind: Literal["array", "number", "object"]
    dims: tuple[Dim, ...] = ()
    dtype: np.dtype[Any] | None = None
    python: Any = None
    port: Port = Port()
    optional: bool = False
    meaning: str = ""

    @property
    def unit(self) -> str:
        return self.port.unit

    def fits(self, shape: tuple[int, ...], sizes: Mapping[str, int] | None = None) -> bool:
        """Return whether an array of this shape has the port's sizes, those that are known."""
        due = [d if isinstance(d, int) else (sizes or {}).get(d) for d in self.dims]
        return len(shape) == len(due) and all(map(lambda d, n: d in (None, n), due, shape))

    def __str__(self) -> str:
        if self.kind == "object":
            return str(getattr(self.python, "__name__", self.python))
        if self.kind == "number":
            return f"number [{self.unit}]"
        assert self.dtype is not None
        return f"{self.dtype.name} {' x '.join(map(str, self.dims))} [{self.unit}]"


def is_record(annotation: Any) -> bool:
    """Return whether `annotation` is a NamedTuple class, that is, a record of ports."""
    return isinstance(annotation, type) and hasattr(annotation, "_fields")


def input_ports(name: str, annotation: Any) -> tuple[dict[str, PortType], type | None]:
    """Return an input's ports by name, and its record, which may be optional; None for one port."""
    members = members_of(annotation)
    record = members[0] if len(members) == 1 and is_record(members[0]) else None
    if record is None:
        return {name: read_port(name, annotation)}, None
    return {port.name: port for port in record_ports(record, f"{name}.").values()}, record


def record_ports(record: type, prefix: str = "") -> dict[str, PortType]:
    """Return the ports of a record, and of records in it, by name, each named ``prefix.name``.

    Raises TypeError if two ports have one name.
    """
    ports: dict[str, PortType] = {}
    for field, annotation in record_fields(record).items():
        if is_record(annotation):
            inner = record_ports(annotation, prefix)
        else:
            inner = {field: read_port(f"{prefix}{field}", annotation)}
        for name in inner.keys() & ports.keys():
            raise TypeError(f"{record.__name__}: two ports are called '{name}'")
        ports |= inner
    return ports


def record_values(record: type, output: Any) -> tuple[Any, ...]:
    """The values of `output` in the order of the record's ports.

    Raises TypeError if `output` is not such a record.
    """
    fields = record_fields(record)
    if not isinstance(output, tuple) or len(output) != len(fields):
        size = f" of {len(output)}" if isinstance(output, tuple) else ""
        raise TypeError(
            f"{record.__name__}({', '.join(fields)}) is declared, but a "
            f"{type(output).__name__}{size} was made"
        )
    values: list[Any] = []
    for annotation, value in zip(fields.values(), output, strict=True):
        values += record_values(annotation, value) if is_record(annotation) else [value]
    return tuple(values)


def make_record(record: type, values: Iterable[Any]) -> Any:
    """Make a record from values in the order of its ports."""
    if not any(_inner_records(record)):
        return record(*values)
    rest = iter(values)
    fields = (
        make_record(inner, islice(rest, len(record_ports(inner)))) if inner else next(rest)
        for inner in _inner_records(record)
    )
    return record(*fields)


@cache
def _inner_records(record: type) -> list[type | None]:
    """The record type of each field; None for a field that is no record."""
    return [inner if is_record(inner) else None for inner in record_fields(record).values()]


@cache
def record_fields(record: type) -> dict[str, Any]:
    """The annotations of a record's fields, in order."""
    hints = typing.get_type_hints(record, include_extras=True)
    return {field: hints[field] for field in record._fields}  # type: ignore[attr-defined]


def read_port(name: str, annotation: Any) -> PortType:
    """Turn one annotation into a `PortType`.

    Raises TypeError if an array or number annotation carries no `Port`.
    """
    members = members_of(annotation)
    if len(members) != 1:
        raise TypeError(f"port '{name}': a union of types cannot be a port")
    optional, annotation = members[0] is not annotation, members[0]
    port: Port | None = None
    meaning = ""
    if typing.get_origin(annotation) is Annotated:
        annotation, *extras = typing.get_args(annotation)
        port = next((e for e in extras if isinstance(e, Port)), None)
        # The outermost words count: a record's field is more specific than its quantity.
        meaning = next((e for e in reversed(extras) if isinstance(e, str)), "")
    annotation = _written_out(annotation)
    if typing.get_origin(annotation) is np.ndarray:
        if port is None:
            raise TypeError(f"port '{name}': an array needs Annotated[..., Port('H W')]")
        scalar = typing.get_args(typing.get_args(annotation)[1])[0]
        dims = tuple(int(d) if d.isdigit() else d for d in port.dims.split())
        dtype = np.dtype(scalar)
        return PortType(name, "array", dims, dtype, port=port, optional=optional, meaning=meaning)
    kind: Literal["number", "object"] = "number" if annotation is float else "object"
    return PortType(
        name, kind, python=annotation, port=port or Port(), optional=optional, meaning=meaning
    )


def _written_out(annotation: Any) -> Any:
    """The type behind an alias: from Python 3.12 and NumPy 2.5 on, `NDArray` is one."""
    alias = typing.get_origin(annotation)
    if not hasattr(alias, "__value__"):
        return annotation
    return alias.__value__[typing.get_args(annotation)]
