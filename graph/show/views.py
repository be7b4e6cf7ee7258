"""Arrays that can be drawn: picked by type, with no knowledge of their meaning.

A float array H x W is a map, an unsigned one whose unit speaks of bits holds labels, a float
array K x H x W is a stack of images.
"""

from dataclasses import dataclass
from typing import Any, Literal

from numpy.typing import NDArray

from tactograph.graph.declare.ports import PortType

Kind = Literal["map", "labels", "planes"]


@dataclass(frozen=True)
class View:
    """An array that can be drawn."""

    name: str
    kind: Kind
    unit: str
    array: NDArray[Any]

    @property
    def is_truth(self) -> bool:
        return self.name == "truth" or self.name.startswith("truth_")


def kind_of(port: PortType) -> Kind | None:
    """The way in which a port's array can be drawn, None if it cannot."""
    if port.kind != "array" or port.dtype is None or port.dims[-2:] != ("H", "W"):
        return None
    is_float = port.dtype.kind == "f"
    if len(port.dims) == 2:
        if is_float:
            return "map"
        return "labels" if port.unit.endswith("bits") else None
    return "planes" if is_float and isinstance(port.dims[0], str) and len(port.dims) == 3 else None
