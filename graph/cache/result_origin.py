"""The origin of a result: a stored result may replace a new one only if the origins are equal."""

import importlib.metadata
import importlib.util
import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from tactograph.graph.backends.device_backend import open_device
from tactograph.graph.backends.kernel_source import kernel_source
from tactograph.graph.declare.find_node import find_node
from tactograph.graph.declare.node import Node
from tactograph.graph.declare.provenance import installed, versions
from tactograph.graph.disk.content_hash import content_hash, digest
from tactograph.graph.disk.file_identity import file_identity
from tactograph.graph.files.flat_graph import CAPTURE_PARAM, Graph
from tactograph.graph.plan import names
from tactograph.graph.plan.draft import Draft

ENGINE_PACKAGE, NODES_PACKAGE = "tactograph.graph", "tactograph.nodes"
NO_SOURCE = {"__pycache__", "commands", "verbs", "tests"}
"""Folders of a package that do not affect results."""
INSTALLED_FOLDERS = ("site-packages", "dist-packages")
_FOR_DEVELOPERS = re.compile(r"""extra == ['"](test|tests|lint|docs|dev)['"]""")


def find_origin(
    graph: Graph,
    arguments: Mapping[str, Any],
    *,
    backend: str | None = None,
    device: str | None = None,
) -> dict[str, Any]:
    """Return everything that determines a graph's outputs, as plain data.

    ``hash`` is the graph's, ``arguments`` are the values of its params.  ``inputs`` has a hash of
    the content of every file or folder that params or reading nodes (``node.param``) name, and the
    sensor that an ``.npz`` states.  ``code`` has a hash of the source of each package and of the
    engine.  ``versions`` are those of Python, this package, the nodes' packages and their
    requirements.  ``device`` is "" if none is used.  Params without a value are left out.

    Raises InputError if a node or the device does not exist.
    """
    draft = names.bind(graph, {**graph.placeholders, **arguments}, sinks=True)
    files = {
        name: value
        for name, value in arguments.items()
        if graph.params[name].kind == "path" and name != "out" and value is not None
    }
    files |= _named_files(draft, {*arguments, CAPTURE_PARAM, "out"})
    nodes = [
        find_node(op, graph.own) for op in sorted({entry.op for entry in graph.nodes.values()})
    ]
    code: dict[str, list[str]] = {}
    for node in nodes:
        code.setdefault(_package(node), []).append(code_of(node))
    packages = versions()
    for package in {node.package for node in nodes}:
        packages |= _versions_around(package)
    preferred = replace(graph, prefer=(backend,)).backends if backend else graph.backends
    opened, _ = open_device(preferred, device)
    hashes = {package: digest({"nodes": each}) for package, each in code.items()}
    origin = {
        "hash": graph.hash,
        "arguments": arguments,
        "inputs": {
            name: {"hash": content_hash(Path(file)), **file_identity(Path(file))}
            for name, file in files.items()
        },
        "backend": backend,
        "code": {"engine": digest({"files": _source(ENGINE_PACKAGE)}), **hashes},
        "versions": packages,
        "device": f"{opened.name}, driver {opened.driver}" if opened is not None else "",
    }
    plain: dict[str, Any] = json.loads(json.dumps(origin, default=str))
    return plain


def _named_files(draft: Draft, params: Iterable[str]) -> dict[str, Path]:
    """The files and folders that the graph names to reading nodes, except by these params."""
    words = {f"${name}" for name in params}
    return {
        f"{task.id}.{name}": value
        for task in draft.tasks.values()
        for name, value in task.settings.items()
        if isinstance(value, Path)
        and not task.node.sink
        and task.entry.settings.get(name) not in words
    }


def code_of(node: Node) -> str:
    """A hash of all source that may affect a node.

    It covers the core's nodes, the node's package, and the kernels with their headers, including
    those of the nodes that it calls.
    """
    kernels = [kernel_source(n) for n in (node, *node.calls.values()) if n.has_kernel]
    files = [*_source(NODES_PACKAGE), *_source(_package(node))]
    return digest({"files": files, "kernels": kernels})


def _package(node: Node) -> str:
    """The package of a node: the core's nodes, a ring that ships, or somebody else's."""
    parts = node.function.__module__.split(".")
    if parts[0] != "tactograph":
        return parts[0]
    return ".".join(parts[: 3 if parts[1] == "rings" else 2])


@cache
def _source(package: str) -> tuple[str, ...]:
    """Hashes of a package's files, or of a module's and those beside it.

    They are read once per process, like modules.  Source that cannot be read equals no other.
    """
    try:
        spec = importlib.util.find_spec(package)
    except (ImportError, ValueError, AttributeError):
        spec = None
    if spec is None or not spec.has_location or not spec.origin:
        return (os.urandom(8).hex(),)
    root = Path(spec.origin).parent
    files = [Path(spec.origin)] if spec.submodule_search_locations is None else [*_below(root)]
    if "." not in package:
        around = root.parent if spec.submodule_search_locations is not None else root
        files += [] if {*INSTALLED_FOLDERS} & {*around.parts} else around.glob("*.py")
    return tuple(sorted({f"{file.name}:{content_hash(file)}" for file in files}))


def _below(folder: Path) -> Iterator[Path]:
    """The files of a folder, and of its subfolders with modules."""
    inside = [*folder.iterdir()]
    if any(each.suffix == ".py" for each in inside):
        yield from (each for each in inside if each.is_file())
    for each in inside:
        if each.is_dir() and each.name not in NO_SOURCE:
            yield from _below(each)


@cache
def _versions_around(package: str) -> Mapping[str, str]:
    """The versions of an installed package and of its requirements."""
    try:
        needs = importlib.metadata.requires(package) or []
    except importlib.metadata.PackageNotFoundError:
        return {}
    packages = [package, *(need for need in needs if not _FOR_DEVELOPERS.search(need))]
    return installed(tuple(re.split(r"[^\w.-]", need, maxsplit=1)[0] for need in packages))
