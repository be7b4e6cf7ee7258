"""The modules that a source file may import, kept on disk from start to start."""

import ast
import json
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from tactograph.graph.disk.disk_cache import KEPT_SUFFIX, cache_folder, read_cached, write_cached

_BLOCK_FIELDS = ("body", "orelse", "finalbody", "handlers", "cases")
"""The fields of a statement that hold other statements."""


class _Imports(NamedTuple):
    """The imports of a file when it was last read."""

    changed: int
    size: int
    names: list[str]


def module_imports(file: Path, module: str) -> list[str]:
    """The full names of the modules that a module's file may import.

    A name may also be that of an object in a module.
    """
    if file.suffix != ".py":
        return []
    stat, known = file.stat(), _known()
    imports = known.get(key := f"{module} {file}")
    if imports is None or (imports.changed, imports.size) != (stat.st_mtime_ns, stat.st_size):
        imports = _Imports(stat.st_mtime_ns, stat.st_size, _imported(file, module))
        known[key] = imports
        _new.append(key)
    return imports.names


def keep_imports() -> None:
    """Keep the new results for other processes."""
    if _new and (file := _kept_in()) is not None:
        known = list(_known().items())
        there = {key: imports for key, imports in known if Path(key.partition(" ")[2]).exists()}
        write_cached(file, json.dumps(there).encode())
        _new.clear()


_new: list[str] = []
"""Keys of results that are not on disk yet."""


@cache
def _known() -> dict[str, _Imports]:
    """The results on disk, by module and file; none if another version wrote them."""
    file = _kept_in()
    body = None if file is None else read_cached(file)
    try:
        return {key: _Imports(*imports) for key, imports in json.loads(body or b"{}").items()}
    except (ValueError, TypeError, AttributeError):
        return {}


def _kept_in() -> Path | None:
    """The file with results, one for each version of Python."""
    folder = cache_folder()
    return (
        None if folder is None else folder / f"imports-{sys.implementation.cache_tag}{KEPT_SUFFIX}"
    )


def _imported(file: Path, module: str) -> list[str]:
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError):
        return []
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    names: dict[str, None] = {}
    for statement in _statements(tree):
        if isinstance(statement, ast.Import):
            names.update(dict.fromkeys(alias.name for alias in statement.names))
        elif isinstance(statement, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) + 1 - statement.level]
            parts = [*(above if statement.level else []), *filter(None, [statement.module])]
            base = ".".join(parts)
            names[base] = None
            names.update(dict.fromkeys(f"{base}.{alias.name}" for alias in statement.names))
    return [name for name in names if name]


def _statements(tree: ast.AST) -> Iterator[ast.AST]:
    """All statements inside one, at any depth, without expressions, which are most of a file."""
    for block in _BLOCK_FIELDS:
        for part in getattr(tree, block, ()):
            yield part
            yield from _statements(part)
