"""What of a result can be looked at: picked by type, with no knowledge of its meaning.

A float array H x W is a map, an unsigned one whose unit speaks of bits holds labels, a float
array K x H x W is a stack of images.  A view called ``truth_shadow`` is the truth for the view
``shadow``; one whose name says nothing of that kind, such as ``truth``, is the truth for the
first view of its kind and unit.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tactograph.graph.declare.ports import PortType
from tactograph.graph.files.array_files import load_arrays
from tactograph.graph.run.result import Result
from tactograph.graph.run.whole_images import in_fractions

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


def views_of(result: Result) -> list[View]:
    """What the graph's source yielded and what its outputs hold, where it can be drawn."""
    named: dict[str, tuple[Any, PortType]] = {}
    for value, array in result.item.items():
        task = result.plan.tasks[value.node]
        named[value.port] = in_fractions(task, array), task.node.outputs[value.port]
    for name, value in result.plan.outputs.items():
        port = result.plan.tasks[value.node].node.outputs[value.port]
        named[name] = result.outputs[name], port
    return [
        View(name, kind, port.unit, array)
        for name, (array, port) in named.items()
        if array is not None and (kind := kind_of(port)) is not None
    ]


def find_truth(view: View, views: Mapping[str, View]) -> View | None:
    """The truth for `view` among `views`, if it is there."""
    for truth in views.values():
        if truth.is_truth and _is_alike(truth, view):
            others = [v for v in views.values() if not v.is_truth and _is_alike(truth, v)]
            named = (v for v in others if truth.name == f"truth_{v.name}")
            if next(named, others[0]).name == view.name:
                return truth
    return None


def _is_alike(one: View, other: View) -> bool:
    return (one.kind, one.unit, one.array.shape) == (other.kind, other.unit, other.array.shape)


def save_views(views: list[View], folder: Path) -> None:
    """Write ``views.npz`` and, what they are, ``views.json``."""
    about = [{"name": v.name, "kind": v.kind, "unit": v.unit} for v in views]
    (folder / "views.json").write_text(json.dumps(about, indent=1) + "\n")
    arrays: dict[str, Any] = {view.name: view.array for view in views}
    np.savez_compressed(folder / "views.npz", **arrays)


def load_views(folder: Path) -> dict[str, View]:
    """Read what `save_views` wrote, by name; nothing where it is not there or damaged."""
    try:
        about = json.loads((folder / "views.json").read_text())
        arrays = load_arrays(folder / "views.npz")
        return {a["name"]: View(a["name"], a["kind"], a["unit"], arrays[a["name"]]) for a in about}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def kind_of(port: PortType) -> Kind | None:
    """How the array of a port can be drawn, if it can."""
    if port.kind != "array" or port.dtype is None or port.dims[-2:] != ("H", "W"):
        return None
    is_float = port.dtype.kind == "f"
    if len(port.dims) == 2:
        if is_float:
            return "map"
        return "labels" if port.unit.endswith("bits") else None
    return "planes" if is_float and isinstance(port.dims[0], str) and len(port.dims) == 3 else None
