"""Keep slow results that do not depend on the stream on disk, for later processes.

A file (`disk_cache`) holds one node's outputs; if it is damaged, they are computed again.
"""

import io
import pickle
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from tactograph.graph.cache.keys import content_key, key_of
from tactograph.graph.declare.node import Node
from tactograph.graph.declare.ports import make_record
from tactograph.graph.declare.provenance import versions
from tactograph.graph.disk.disk_cache import CACHE_SUFFIX, cache_folder, read_cached, write_cached
from tactograph.graph.errors import collect_warnings, warn

MIN_STORED_MS = 200.0
"""Smallest time that justifies a file."""
_ARRAY_CLASSES = {"_reconstruct", "_frombuffer", "scalar", "ndarray", "dtype"}


def recall_or_make(
    node: Node, settings: dict[str, Any], arguments: Sequence[Any], make: Callable[[], Any]
) -> Any:
    """Return the result of a node, from disk if a slow result was kept.

    A result with a warning is not kept, since a file does not keep the warning.
    """
    folder = cache_folder()
    if folder is None:
        return make()
    file: Path | None = None
    if has_stored(node):
        file = _file(folder, node, settings, arguments)
        stored = _read(file, node)
        if stored is not None:
            return stored[0]
    start = time.perf_counter()
    warnings: list[str] = []
    try:
        with collect_warnings(warnings):
            result = make()
    finally:
        for warning in warnings:
            warn(warning)
    if not warnings and 1e3 * (time.perf_counter() - start) > MIN_STORED_MS:
        _write(file or _file(folder, node, settings, arguments), node, result)
    return result


def has_stored(node: Node) -> bool:
    """Return whether earlier results of a node are on disk; its inputs decide whether one fits."""
    folder = cache_folder()
    return folder is not None and any(folder.glob(f"{node.name}-*{CACHE_SUFFIX}"))


def _file(folder: Path, node: Node, settings: dict[str, Any], arguments: Sequence[Any]) -> Path:
    from tactograph.graph.cache.result_origin import code_of

    key = key_of(
        code_of(node), sorted(versions().items()), sorted(settings.items()), content_key(*arguments)
    )
    return folder / f"{node.name}-{key}{CACHE_SUFFIX}"


def _read(file: Path, node: Node) -> tuple[Any] | None:
    """The content of a file, or None if it is unusable."""
    body = read_cached(file)
    if body is None:
        return None
    try:
        content, record = _Reader(io.BytesIO(body)).load(), node.output_record
        return (content if record is None else make_record(record, content),)
    except Exception:  # the node can make it again
        return None


def _write(file: Path, node: Node, result: Any) -> None:
    """Keep a node's result, if it is plain data."""
    with suppress(Exception):
        plain = result if node.output_record is None else node.results(result)
        body = pickle.dumps(plain, protocol=5)
        _Reader(io.BytesIO(body)).load()  # keep only what can be read back
        write_cached(file, body)


class _Reader(pickle.Unpickler):
    """Reads arrays and plain data, and runs no code that a file names."""

    def find_class(self, module: str, name: str) -> Any:
        if module.partition(".")[0] == "numpy" and name in _ARRAY_CLASSES:
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"{module}.{name} is not kept on disk")
