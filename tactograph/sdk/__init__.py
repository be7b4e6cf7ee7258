"""What a ring may import: these names stay within a minor version (docs/sdk.md).

The names and their modules are in ``__init__.pyi``, which type checkers read.  A name is imported
when it is first used, so that a node file loads no more than it needs.  `tactograph.sdk.nodes` has
any node, `tactograph.sdk.unstable` what the shipped rings use beyond, without that promise.
"""

from collections.abc import Callable
from typing import Any

from tactograph.sdk._late_names import late_names


def __getattr__(name: str) -> Any:
    return _late(name)


def __dir__() -> list[str]:
    return [*sources()]


sources: Callable[[], dict[str, str]]
_late, sources = late_names(__name__, __file__)
