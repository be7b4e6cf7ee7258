"""What took long to make and does not depend on a stream, kept on disk from start to start.

A file holds one node's outputs.  It is written beside its place and moved there, so two writers
and a kill leave whole files; its content is checked when it is read, and one that is damaged is
made again.  The files that were read longest ago go when all are too large.
"""

from __future__ import annotations

import io
import os
import pickle
import tempfile
import time
import zlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import platformdirs

from tactograph.graph.declare.node import Node
from tactograph.graph.declare.provenance import versions
from tactograph.graph.run.keys import content_key, key_of

FOLDER = "TACTOGRAPH_CACHE"
"""The environment variable that names another folder, or is ``off``."""
MOST_BYTES = 10**9
"""Of all files together."""
SLOW_MS = 200.0
"""What is made faster than that is not worth a file."""
_MAGIC = b"tactograph kept 1\n"
_SUFFIX = ".kept"
_ABANDONED_S = 3600.0
_ARRAYS = {"_reconstruct", "_frombuffer", "scalar", "ndarray", "dtype"}


def recall_or_make(
    node: Node, settings: dict[str, Any], arguments: Sequence[Any], make: Callable[[], Any]
) -> Any:
    """What a node makes of settings and inputs, taken from disk if it was slow before."""
    folder = _folder()
    if folder is None:
        return make()
    file: Path | None = None
    if any(folder.glob(f"{node.name}-*{_SUFFIX}")):
        file = _file(folder, node, settings, arguments)
        found = _read(file, node)
        if found is not None:
            return found[0]
    start = time.perf_counter()
    made = make()
    if 1e3 * (time.perf_counter() - start) > SLOW_MS:
        _write(file or _file(folder, node, settings, arguments), made)
    return made


def _folder() -> Path | None:
    told = os.environ.get(FOLDER, "")
    if told == "off":
        return None
    return Path(told or platformdirs.user_cache_dir("tactograph", appauthor=False))


def _file(folder: Path, node: Node, settings: dict[str, Any], arguments: Sequence[Any]) -> Path:
    from tactograph.graph.run.result_origin import code_of

    key = key_of(
        code_of(node), sorted(versions().items()), sorted(settings.items()), content_key(*arguments)
    )
    return folder / f"{node.name}-{key}{_SUFFIX}"


def _read(file: Path, node: Node) -> tuple[Any] | None:
    """What a file holds; None if it is absent, damaged or somebody else's."""
    try:
        if hasattr(os, "getuid") and file.stat().st_uid != os.getuid():
            return None
        with file.open("rb") as stream:
            if stream.readline() != _MAGIC:
                return None
            check, body = stream.readline().strip(), stream.read()
        if f"{zlib.crc32(body):08x}".encode() != check:
            return None
        found = _Reader(io.BytesIO(body)).load()
        os.utime(file)
    except Exception:  # whatever is wrong with it, the node can make it again
        return None
    return (_as_declared(found, node),)


def _write(file: Path, made: Any) -> None:
    """Keep what a node made; a full disk or a read-only one is no reason to fail."""
    plain = tuple(made) if isinstance(made, tuple) else made
    stage: Path | None = None
    with suppress(Exception):
        body = pickle.dumps(plain, protocol=5)
        if len(body) > MOST_BYTES // 4:
            return
        _Reader(io.BytesIO(body)).load()  # only what can be read again
        file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        number, name = tempfile.mkstemp(prefix=".writing-", dir=file.parent)
        stage = Path(name)
        with os.fdopen(number, "wb") as stream:
            check = f"{zlib.crc32(body):08x}"
            stream.write(_MAGIC + check.encode() + b"\n" + body)
        stage.replace(file)
        _make_room(file)
    if stage is not None:
        with suppress(OSError):
            stage.unlink(missing_ok=True)


def _make_room(new: Path) -> None:
    """Delete what was read longest ago, and what a killed writer left."""
    stats = []
    for file in new.parent.iterdir():
        with suppress(OSError):
            stats.append((file.stat().st_mtime, file.stat().st_size, file))
    total = 0
    for changed, size, file in sorted(stats, reverse=True):
        if file.name.startswith(".writing-"):
            if time.time() - changed > _ABANDONED_S:
                file.unlink(missing_ok=True)
        elif file.suffix == _SUFFIX:
            total += size
            if total > MOST_BYTES and file != new:
                file.unlink(missing_ok=True)


def _as_declared(found: Any, node: Node) -> Any:
    return node.output_record(*found) if node.output_record is not None else found


class _Reader(pickle.Unpickler):
    """Reads arrays, plain data and SciPy's trees, and runs no code that a file names."""

    def find_class(self, module: str, name: str) -> Any:
        top = module.partition(".")[0]
        is_tree = top == "scipy" and module.startswith("scipy.spatial") and name == "cKDTree"
        if (top == "numpy" and name in _ARRAYS) or is_tree:
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"{module}.{name} is not kept on disk")
