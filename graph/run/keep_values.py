"""Write values from inside a graph beside its results: as .npy files and as pictures."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tactograph.graph.disk.atomic_files import atomic_files
from tactograph.graph.errors import InputError, did_you_mean
from tactograph.graph.files.flat_graph import Graph, split_reference
from tactograph.graph.files.groups import flat_reference
from tactograph.graph.run.result import Result


def read_selection(text: str, graph: Graph) -> dict[str, str]:
    """Read ``label.misfit,light,pressure`` (nodes and outputs of a graph) into references by name.

    Raises InputError if the text names nothing, or something that the graph does not have.
    """
    names = [word.strip() for word in text.split(",") if word.strip()]
    if not names:
        raise InputError(f"--keep {text}: write it as node.port,node")
    return {name: _reference(name, graph) for name in names}


def _reference(name: str, graph: Graph) -> str:
    # Only an input of a group can resolve to None, so here there is a name.
    flat = flat_reference(graph, name, "", f"--keep {name}") or name
    if split_reference(flat, graph.nodes)[0] in graph.nodes:
        return name
    if name not in graph.outputs:
        hint = did_you_mean(name, {**graph.nodes, **graph.outputs})
        raise InputError(f"--keep {name}: {graph.name} has no node or output of that name{hint}")
    return graph.outputs[name]


def write_selection(result: Result, names: Mapping[str, str], folder: Path) -> None:
    """Write the values of one item.  Raises WriteError if it cannot write to the folder."""
    from tactograph.graph.show.pictures import png_of

    with atomic_files(folder) as stage:
        for name in names:
            value = result[name]
            if isinstance(value, np.ndarray):
                np.save(stage / f"{name}.npy", value)
                picture = png_of(name, result.plan.port(name), value)
                if picture is not None:
                    (stage / f"{name}.png").write_bytes(picture)
            elif value is not None:
                text = json.dumps(value, default=str, indent=1)
                (stage / f"{name}.json").write_text(f"{text}\n", encoding="utf-8")
