"""Values from inside a graph, written beside its results: as .npy, and as pictures."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tactograph.graph.errors import InputError
from tactograph.graph.files.atomic_files import atomic_files
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.plan.plan import Plan
from tactograph.graph.run.result import Result


def with_kept(graph: Graph, references: Mapping[str, str], *, only: bool = False) -> Graph:
    """The graph with further values put out, by the names that they are written under."""
    outputs = {} if only else dict(graph.outputs)
    return replace(graph, outputs={**outputs, **references})


def read_kept(text: str) -> dict[str, str]:
    """Read ``label.misfit,light`` into references by name.

    Raises
    ------
    InputError
        If nothing is named.
    """
    names = [word.strip() for word in text.split(",") if word.strip()]
    if not names:
        raise InputError(f"--keep {text}: write it as node.port,node")
    return {name: name for name in names}


def write_kept(result: Result, names: Mapping[str, str], folder: Path) -> None:
    """Write the values of one item.

    Raises
    ------
    WriteError
        If the folder cannot be written.
    """
    with atomic_files(folder) as stage:
        for name in names:
            value = result[name]
            if isinstance(value, np.ndarray):
                np.save(stage / f"{name}.npy", value)
                picture = picture_of(result.plan, name, value)
                if picture is not None:
                    (stage / f"{name}.png").write_bytes(picture)
            elif value is not None:
                text = json.dumps(value, default=str, indent=1)
                (stage / f"{name}.json").write_text(f"{text}\n", encoding="utf-8")


def picture_of(plan: Plan, name: str, array: Any) -> bytes | None:
    """An output as a PNG with its scale; None for what is no picture."""
    from tactograph.graph.compare.drawable_arrays import View, kind_of
    from tactograph.graph.compare.pictures import draw_labels, draw_maps, draw_planes

    value = plan.outputs[name]
    port = plan.tasks[value.node].node.outputs[value.port]
    kind = kind_of(port)
    is_stack = array.ndim == 3 and port.dims[-2:] == ("H", "W") and array.dtype.kind == "f"
    if not (kind or is_stack) or not array.size or not np.isfinite(array).any():
        return None
    label = f"{name} / {port.unit}"
    if kind == "planes":
        uri = draw_planes(View(name, kind, port.unit, array))
    elif kind == "labels":
        uri = draw_labels({name: array}, port.unit)
    else:
        planes = {name: array} if array.ndim == 2 else dict(enumerate(array, start=1))
        uri = draw_maps({str(title): plane for title, plane in planes.items()}, label)
    return base64.b64decode(uri.partition(",")[2])
