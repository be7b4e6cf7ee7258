"""Keep the views of a run on disk, and find the truth for each.

A view called ``truth_shadow`` is the truth for the view ``shadow``; a view called ``truth`` is the
truth for the first view of the same kind and unit.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tactograph.graph.declare.ports import PortType
from tactograph.graph.disk.array_files import load_arrays
from tactograph.graph.run.integer_images import in_fractions
from tactograph.graph.run.result import Result
from tactograph.graph.show.views import View, kind_of


def views_of(result: Result) -> list[View]:
    """Values of the graph's source and outputs that can be drawn."""
    named: dict[str, tuple[Any, PortType]] = {}
    for value, array in result.item.items():
        task = result.plan.tasks[value.node]
        named[value.port] = in_fractions(task, array), task.node.outputs[value.port]
    for name in result.plan.outputs:
        named[name] = result.outputs[name], result.plan.port(name)
    return [
        View(name, kind, port.unit, array)
        for name, (array, port) in named.items()
        if array is not None and (kind := kind_of(port)) is not None
    ]


def find_truth(view: View, views: Mapping[str, View]) -> View | None:
    """The truth for `view` among `views`, or None."""
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
    """Write ``views.npz`` and their description, ``views.json``."""
    about = [{"name": v.name, "kind": v.kind, "unit": v.unit} for v in views]
    (folder / "views.json").write_text(json.dumps(about, indent=1) + "\n")
    arrays: dict[str, Any] = {view.name: view.array for view in views}
    np.savez_compressed(folder / "views.npz", **arrays)


def load_views(folder: Path) -> dict[str, View]:
    """Read the views of `save_views`, by name; none if they are absent or damaged."""
    try:
        about = json.loads((folder / "views.json").read_text())
        arrays = load_arrays(folder / "views.npz")
        return {a["name"]: View(a["name"], a["kind"], a["unit"], arrays[a["name"]]) for a in about}
    except (OSError, ValueError, KeyError, TypeError):
        return {}
