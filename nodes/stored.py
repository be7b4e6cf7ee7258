"""The fields of a record that a file keeps: their limits, and their values for a plain sensor."""

import typing
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from tactograph.graph.declare.annotations import members_of
from tactograph.graph.declare.ports import PortType, is_record, read_port


@dataclass(frozen=True)
class Stored:
    """Metadata of a record's field that a file keeps, in addition to its `Port` and its meaning.

    Parameters
    ----------
    low, high : limits for any sensor; a file with a value beyond them is damaged
    plain
        The value for a plain sensor: numbers, repeated to the declared shape, or the name of the
        field whose value to take.  None: every sensor has its own value.
    """

    low: float = -np.inf
    high: float = np.inf
    plain: float | tuple[float, ...] | str | None = None


class Value(NamedTuple):
    """A value of a file: its port, and its limits."""

    port: PortType
    stored: Stored

    @property
    def dtype(self) -> np.dtype[Any]:
        return self.port.dtype or np.dtype(np.float32)


@cache
def stored_values(record: type) -> Mapping[str, Value]:
    """The `Stored` fields of a record, by name."""
    values: dict[str, Value] = {}
    for name, annotation in typing.get_type_hints(record, include_extras=True).items():
        if is_record(annotation):
            values |= stored_values(annotation)
        (inner, *_) = members_of(annotation) or (annotation,)
        for extra in getattr(inner, "__metadata__", ()):
            if isinstance(extra, Stored):
                values[name] = Value(read_port(name, annotation), extra)
    return values


def with_plain(record: type, stated: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a record; missing ones are those of a plain sensor.

    New arrays have the sizes of the `stated` ones, and the highest precision among them.
    """
    values = stored_values(record)
    arrays = {name: stated[name] for name in values if np.ndim(stated.get(name, 0))}
    sizes = {
        dim: size
        for name, array in arrays.items()
        for dim, size in zip(values[name].port.dims, array.shape, strict=True)
    }
    exact = np.result_type(np.float32, *(array.dtype for array in arrays.values()))
    filled = dict(stated)
    for name, (port, stored) in values.items():
        if name in stated:
            continue
        plain = stated[stored.plain] if isinstance(stored.plain, str) else stored.plain
        filled[name] = plain
        if port.dims:
            shape = [dim if isinstance(dim, int) else sizes[dim] for dim in port.dims]
            counts = port.dtype is not None and port.dtype.kind == "u"
            typed = np.asarray(plain, port.dtype if counts else exact)
            filled[name] = np.array(np.broadcast_to(typed, shape))
    return filled
