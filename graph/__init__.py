"""The engine: read a graph file, check it, plan its run, and run it on NumPy or a device.

All that it knows of optics is that images are lights x rows x columns.

>>> from tactograph.graph import load
>>> pipeline = load("reconstruct", calibration="cal.npz")  # doctest: +SKIP
>>> height = pipeline(frames=stack)["height"]  # doctest: +SKIP
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from tactograph.graph.declare.declare_node import node
from tactograph.graph.declare.engine_arguments import (
    EVERYTHING,
    KeepIntegers,
    NodeCall,
    Session,
    Wanted,
)
from tactograph.graph.declare.node import Node
from tactograph.graph.declare.ports import NamedPorts, Port
from tactograph.graph.declare.provenance import Provenance
from tactograph.graph.declare.size_rules import SizeLimit, SizeRule
from tactograph.graph.declare.tolerance import Close
from tactograph.graph.errors import (
    EndOfStream,
    GraphError,
    InputError,
    NodeError,
    TactographError,
    warn,
)

if TYPE_CHECKING:
    from tactograph.graph.backends import parity
    from tactograph.graph.cache.cache import Cache
    from tactograph.graph.run.open_pipeline import load
    from tactograph.graph.run.pipeline import Pipeline

__all__ = [
    "EVERYTHING",
    "Cache",
    "Close",
    "EndOfStream",
    "GraphError",
    "InputError",
    "KeepIntegers",
    "NamedPorts",
    "Node",
    "NodeCall",
    "NodeError",
    "Pipeline",
    "Port",
    "Provenance",
    "Session",
    "SizeLimit",
    "SizeRule",
    "TactographError",
    "Wanted",
    "load",
    "node",
    "parity",
    "warn",
]


_LATE_MODULES = {
    "Cache": "cache.cache",
    "Pipeline": "run.pipeline",
    "load": "run.open_pipeline",
    "parity": "backends.parity",
}
"""Names that a node file does not need, with their modules: importing the planner is slow."""


def __getattr__(name: str) -> Any:
    if name not in _LATE_MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = importlib.import_module(f"{__name__}.{_LATE_MODULES[name]}")
    return module if name == "parity" else getattr(module, name)
