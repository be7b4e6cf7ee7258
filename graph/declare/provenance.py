"""The provenance of a result, which the engine supplies to a sink that asks for it."""

import importlib.metadata
import platform
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from typing import Any

_RECORDED_PACKAGES = (
    "tactograph",
    "numpy",
    "scipy",
    "pyopencl",
    "pyvkfft",
    "opencv-contrib-python-headless",
)


@dataclass(frozen=True)
class Provenance:
    """How an item's values came about: graph, params, back ends, times and warnings.

    A sink asks for it by a keyword-only argument of this type.  `as_dict` goes into
    ``result.json``.
    """

    graph: dict[str, Any]
    device: str | None
    nodes: list[dict[str, Any]]
    sizes: dict[str, int]
    versions: dict[str, str]
    warnings: list[str]
    fallbacks: list[str]
    arguments: dict[str, Any] = field(default_factory=dict)
    """The values of the graph's params, defaults included."""
    inputs: dict[str, dict[str, str]] = field(default_factory=dict)
    """For each ``.npz`` file among the params: its hash, and sensor, serial and date if known."""

    def as_dict(self) -> dict[str, Any]:
        return {"format": 1, **vars(self)}


def versions() -> dict[str, str]:
    """The versions a result depends on."""
    return {"python": platform.python_version(), **installed(_RECORDED_PACKAGES)}


@cache
def installed(packages: tuple[str, ...]) -> Mapping[str, str]:
    """The versions of the packages that are installed; cached, as every item of a stream asks."""
    versions_of: dict[str, str] = {}
    for name in packages:
        with suppress(importlib.metadata.PackageNotFoundError):
            versions_of[name] = importlib.metadata.version(name)
    return versions_of
