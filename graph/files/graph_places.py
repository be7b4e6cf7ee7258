"""Folders of graph files: those of the core, of rings, and the user's own."""

import os
from pathlib import Path
from typing import Literal

from tactograph.graph.errors import InputError, did_you_mean
from tactograph.graph.rings import rings

_CHANGE_FOLDERS = ("overlays", "studies", "variants")
"""Folders whose files change graphs."""
Shipped = Literal["graphs", "overlays", "studies", "groups"]
"""Kinds of files that ship."""
_FILE_PATTERNS: dict[Shipped, str] = {
    "graphs": "*/*.yaml",
    "overlays": "overlays/*.yaml",
    "studies": "studies/*.yaml",
    "groups": "*/*.group.yaml",
}


def shipped(kind: Shipped) -> dict[str, Path]:
    """The files of a kind that ship, those of the core and of all rings, by name without ``.yaml``.

    A file of the core or of a shipped ring has precedence.  If several other rings have a file of
    one name, it has to be named ``ring/name``.
    """
    files: dict[str, list[tuple[Path, bool]]] = {}
    for ring in rings():
        for file in ring.files("pipelines", _FILE_PATTERNS[kind]):
            is_other = file.parent.name in _CHANGE_FOLDERS or file.stem.endswith(".group")
            if kind != "graphs" or not is_other:
                files.setdefault(file.stem, []).append((file, ring.shipped))
    firsts = {name: (*found[0], len(found)) for name, found in files.items()}
    return {name: file for name, (file, ships, count) in firsts.items() if ships or count == 1}


def variants_added_to(name: str) -> list[Path]:
    """The files with which rings add variants to a graph that ships."""
    return [file for ring in rings() for file in ring.files("pipelines", f"variants/{name}.yaml")]


def find_file(name: str, base_folder: Path | None, kind: Shipped) -> Path | None:
    """The file of a bare name, a ``ring/name`` or a path; None if no shipped file has a bare name.

    Raises InputError if a ``ring/name`` or a path does not exist.
    """
    bringer, slash, graph = name.partition("/")
    ring = next((each for each in rings() if each.name == bringer), None)
    if slash and "/" not in graph and not graph.endswith((".yaml", ".yml")) and ring is not None:
        files = {file.stem: file for file in ring.files("pipelines", "*/*.yaml")}
        if graph in files:
            return files[graph]
        raise InputError(
            f"the ring {bringer} brings no pipeline '{graph}'{did_you_mean(graph, files)}"
            f" (it brings: {', '.join(files) or 'none'})"
        )
    if not is_path(name):
        return shipped(kind).get(name)
    path = Path(name)
    if base_folder is not None and not path.is_absolute():
        path = base_folder / path
    if os.path.isfile(path):  # noqa: PTH113  (False for a name that no file can have)
        return path
    ships = shipped(kind) if path.name == name else {}
    if (bare := name.removesuffix(".yaml")) in ships:
        return ships[bare]
    raise InputError(f"{path}: there is no such graph file")


def is_path(name: str) -> bool:
    """True if the name is the path of a file."""
    return name.endswith((".yaml", ".yml")) or "/" in name
