"""Write a changed graph as a variant of another: `extends`, and the fewest changes."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.main import YAML

from tactograph.sdk import Graph, InputError, atomic_files, nodes, read_graph

Change = dict[str, Any]


def defaults_of(op: str) -> dict[str, Any]:
    """Return the parameters that a node has without a word in the file."""
    return {name: declared.default for name, declared in getattr(nodes, op).parameters.items()}


def changes_between(base: Graph, graph: Graph) -> list[Change]:
    """Return the patch that turns `base` into `graph`, which has the same nodes."""
    changes: list[Change] = []
    for name, entry in graph.nodes.items():
        old = base.nodes[name]
        if entry == old:
            continue
        if old.neutral and not entry.neutral:
            # No verb restores a node; replacing it by itself does.
            whole: Change = {"replace": name, "op": entry.op}
            changes.append({**whole, "with": dict(entry.settings)} if entry.settings else whole)
            old = replace(entry, backend=None, neutral=False)
        before = {**defaults_of(entry.op), **old.settings}
        changed = {n: v for n, v in entry.settings.items() if (n, v) not in before.items()}
        if changed:
            changes.append({"set": name, "with": changed})
        if entry.backend is not None and entry.backend != old.backend:
            changes.append({"backend": name, "to": entry.backend})
        if entry.neutral and not old.neutral:
            changes.append({"neutral": name})
    return _once_for_all_uses(base, changes)


def _once_for_all_uses(graph: Graph, changes: list[Change]) -> list[Change]:
    """Merge changes that all uses of a group share into one of the group."""
    merged: list[Change] = []
    for change in changes:
        verb = next(iter(change))
        path, _, node = change[verb].rpartition(".")
        alike = graph.alike(change[verb])
        if path in graph.uses and all({**change, verb: each} in changes for each in alike):
            change = {**change, verb: f"{graph.uses[path].group}.{node}"}
        if change not in merged:
            merged.append(change)
    return merged


def write_variant(file: Path, source: str, changes: list[Change], title: str) -> Graph:
    """Write the variant of the graph that `source` names, and read it back.

    Raises InputError if nothing was changed, or the file's name is no graph file's; WriteError if
    it cannot be written.
    """
    if not changes:
        raise InputError("nothing was changed: there is no variant to save")
    if file.suffix not in (".yaml", ".yml"):
        raise InputError(f"{file}: the name of a graph file has to end in .yaml")
    is_name = "/" not in source or (source.count("/") == 1 and not Path(source).is_file())
    if ".y" in source or not is_name:  # else a graph, or RING/GRAPH, that is installed
        source = os.path.relpath(source, file.parent)
        source = source if "/" in source or source.endswith((".yaml", ".yml")) else f"./{source}"
    document = CommentedMap(format=1, extends=source, title=title)
    patch = CommentedSeq()
    for change in changes:
        entry = CommentedMap(change)
        if "with" in change:
            entry["with"] = CommentedMap(change["with"])
            entry["with"].fa.set_flow_style()
        patch.append(entry)
    document["patch"] = patch
    yaml = YAML()
    yaml.indent(mapping=2, sequence=4, offset=2)
    yaml.width = 100
    with atomic_files(file.parent, target=file) as stage:
        yaml.dump(document, stage / file.name)
    return read_graph(file)
