"""The origin of a result.  A stored result may stand for a new one only if it is the same."""

import hashlib
import importlib
import importlib.metadata
import importlib.util
import json
import os
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import resolve_name
from modulefinder import ModuleFinder
from pathlib import Path
from types import CodeType
from typing import Any

import tactograph.graph
from tactograph.graph.backends.device_backend import open_device
from tactograph.graph.backends.kernel_source import kernel_text
from tactograph.graph.declare.find_node import find_node, node_places
from tactograph.graph.declare.node import Node
from tactograph.graph.declare.provenance import installed, versions
from tactograph.graph.disk.content_hash import content_hash
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.plan.draft import Draft

ENGINE_PACKAGE = "tactograph.graph"
SDK_PACKAGE = "tactograph.sdk"
PACKAGE_FOLDERS = ("site-packages", "dist-packages")
_IMPORT_FINDER = ModuleFinder()
_FOR_DEVELOPERS = re.compile(r"""extra == ['"](test|tests|lint|docs|dev)['"]""")


@dataclass(frozen=True)
class Origin:
    """All that makes a graph's results, apart from the graph and its data.

    `code` has, by node and for the engine, a hash of all its source.  `versions` are of Python,
    this package, the nodes' packages, and all that these need.  `device` is "" where none is used.
    """

    code: dict[str, str]
    versions: dict[str, str]
    device: str


def find_origin(graph: Graph, *, backend: str | None = None, device: str | None = None) -> Origin:
    """Find the origin that this graph's results would have here and now.

    Raises InputError if a node or the device is not there.
    """
    nodes = [
        find_node(op, graph.own) for op in sorted({entry.op for entry in graph.nodes.values()})
    ]
    code = {node.name: code_of(node) for node in nodes}
    packages = versions()
    for package in {node.package for node in nodes}:
        packages |= _versions_around(package)
    names = replace(graph, prefer=(backend,)).backends if backend else graph.backends
    opened, _ = open_device(names, device)
    name = f"{opened.name}, driver {opened.driver}" if opened is not None else ""
    return Origin({"engine": _engine(), **code}, dict(sorted(packages.items())), name)


def named_files(draft: Draft, given: Iterable[str]) -> dict[str, Path]:
    """The files and folders that the graph itself names to nodes that read, by ``node.param``."""
    words = {f"${name}" for name in given}
    return {
        f"{task.id}.{name}": value
        for task in draft.tasks.values()
        for name, value in task.settings.items()
        if isinstance(value, Path)
        and not task.node.sink
        and task.entry.settings.get(name) not in words
    }


def digest(about: Mapping[str, Any]) -> str:
    """SHA-256 (first 16 digits) of plain data."""
    text = json.dumps(about, sort_keys=True, separators=(",", ":"), default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def code_of(node: Node) -> str:
    """A hash of all source of a node.

    It covers the node's module, all that this imports from the same package or this project, the
    packages' data files, and the kernels with their headers, also of the nodes that it calls.
    """
    seen = {file: _hash(file) for file in _closure(node)}
    kernels = [kernel_text(n) for n in (node, *node.calls.values()) if n.has_kernel]
    if not seen:  # source that cannot be read is never the same
        return os.urandom(8).hex()
    return digest({"files": sorted(seen.values()), "kernels": kernels})


def _closure(node: Node) -> set[Path]:
    """The files of a node's module and of all its imports, direct or not."""
    module = node.function.__module__
    waiting = [_spec(module)]
    files: set[Path] = set()
    while waiting:
        spec = waiting.pop()
        if spec is None or not spec.has_location or not spec.origin:
            continue
        file = Path(spec.origin)
        if file in files or not file.is_file():
            continue
        files.add(file)
        if spec.submodule_search_locations is not None:
            source = (".py", ".pyc", ".cl", ".clh")
            files |= {f for f in file.parent.iterdir() if f.is_file() and f.suffix not in source}
        parents = [spec.name.rpartition(".")[0]] if "." in spec.name else []
        for name in (*parents, *_imports(spec.name, file.stat().st_mtime_ns)):
            behind = _behind_sdk(name)
            if _belongs(behind, module):
                waiting.append(_spec(behind))
    return files


def _behind_sdk(name: str) -> str:
    """The module that a name of the sdk comes from; any other name as it is."""
    package, _, last = name.rpartition(".")
    if package == f"{SDK_PACKAGE}.nodes" and last in node_places():
        return node_places()[last].module
    if package in (SDK_PACKAGE, f"{SDK_PACKAGE}.unstable"):
        sources: Mapping[str, str] = importlib.import_module(package).sources()
        return sources.get(last, name)
    return name


def _belongs(name: str, module: str) -> bool:
    """Return whether a module belongs to the project, or to the package of a node's own module."""
    top, own = name.partition(".")[0], module.partition(".")[0]
    if name == ENGINE_PACKAGE or name.startswith(f"{ENGINE_PACKAGE}."):
        return False
    if top in ("tactograph", own):
        return True
    here = _folder(top)
    return here is not None and here == _folder(own) and not {*PACKAGE_FOLDERS} & {*here.parts}


@cache
def _folder(top: str) -> Path | None:
    """The folder of a top-level module or package."""
    spec = _spec(top)
    if spec is None or not spec.has_location or not spec.origin:
        return None
    file = Path(spec.origin)
    return file.parent.parent if spec.submodule_search_locations is not None else file.parent


def _spec(name: str) -> ModuleSpec | None:
    """The spec of a module; None if there is none by that name.

    A plain module is not searched, since that would run it.
    """
    parent = name.rpartition(".")[0]
    above = _spec(parent) if parent else None
    if parent and (above is None or above.submodule_search_locations is None):
        return None
    try:
        return importlib.util.find_spec(name)
    except (ImportError, ValueError, AttributeError):
        return None


@cache
def _imports(module: str, changed: int) -> list[str]:
    """The full names of what a module's bytecode imports: modules, or objects in them."""
    spec, names = _spec(module), dict[str, None]()
    if spec is None or not spec.origin or not spec.origin.endswith(".py"):
        return []
    package = module if spec.submodule_search_locations is not None else module.rpartition(".")[0]
    with suppress(SyntaxError, ValueError, ImportError):  # the node itself tells
        # Not by its own loader: that of pytest has no code to give.
        codes = [SourceFileLoader(module, spec.origin).get_code(module)]
        for code in filter(None, codes):  # a list that grows by the functions and classes in each
            codes += [each for each in code.co_consts if isinstance(each, CodeType)]
            for kind, found in _IMPORT_FINDER.scan_opcodes(code):
                if kind == "store":
                    continue
                attributes, name = found[-2:]
                base = resolve_name("." * found[0] + name, package) if len(found) == 3 else name
                names |= dict.fromkeys([base, *(f"{base}.{each}" for each in attributes or ())])
    return list(names)


def _hash(file: Path) -> str:
    return f"{file.name}:{content_hash(file)}"


def _engine() -> str:
    """A hash of the engine without its commands."""
    folders = [Path(place) for place in tactograph.graph.__path__]
    files = sorted(file for folder in folders for file in folder.rglob("*.py"))
    return digest({"files": [_hash(file) for file in files if file.parent.name != "commands"]})


@cache
def _versions_around(package: str) -> Mapping[str, str]:
    """The versions of an installed package and of what it may need."""
    try:
        needs = importlib.metadata.requires(package) or []
    except importlib.metadata.PackageNotFoundError:
        return {}
    wanted = [package, *(need for need in needs if not _FOR_DEVELOPERS.search(need))]
    return installed(tuple(re.split(r"[^\w.-]", need, maxsplit=1)[0] for need in wanted))
