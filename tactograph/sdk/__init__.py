"""What a ring may import: these names stay within a minor version (docs/sdk.md).

The names and their modules are in ``__init__.pyi``, which type checkers read.  A name is imported
when it is first used, so that a node file loads no more than it needs.  `tactograph.sdk.nodes` has
any node.
"""

import ast
import importlib
from functools import cache
from pathlib import Path
from typing import Any


@cache
def sources() -> dict[str, str]:
    """Return the module of every name."""
    stub = ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = (each for each in stub.body if isinstance(each, ast.ImportFrom))
    return {alias.name: str(each.module) for each in imports for alias in each.names}


def __dir__() -> list[str]:
    return [*sources()]


@cache
def __getattr__(name: str) -> Any:
    if name not in sources():
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(sources()[name]), name)
