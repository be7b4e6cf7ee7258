"""Names of other modules that are imported when they are first used."""

import ast
import importlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any


def late_names(module: str, file: str) -> tuple[Callable[[str], Any], Callable[[], dict[str, str]]]:
    """Return ``__getattr__`` for a module, and the module of every name that its stub imports."""

    @cache
    def sources() -> dict[str, str]:
        stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
        imports = (each for each in stub.body if isinstance(each, ast.ImportFrom))
        return {alias.name: str(each.module) for each in imports for alias in each.names}

    @cache
    def late(name: str) -> Any:
        if name not in sources():
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        return getattr(importlib.import_module(sources()[name]), name)

    return late, sources
