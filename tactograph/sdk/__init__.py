"""What a ring may import: all of it stays as documented within a minor version (docs/sdk.md).

The names and where they come from are in ``__init__.pyi``, which type checkers read.  A name is
imported when it is first used, so that a node file loads no more than it needs.  Any node is in
`tactograph.sdk.nodes`, by the name that a graph gives it.
"""

import ast
import importlib
from functools import cache
from pathlib import Path
from typing import Any


@cache
def sources() -> dict[str, str]:
    """The module of every name."""
    stub = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = (each for each in stub.body if isinstance(each, ast.ImportFrom))
    return {alias.name: str(each.module) for each in imports for alias in each.names}


def __getattr__(name: str) -> Any:
    if name not in sources():
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(sources()[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(sources())
