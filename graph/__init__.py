"""The engine: read a graph file, check it, plan its run, and run it on NumPy or a device.

All that it knows of optics is that images are lights x rows x columns.

>>> from tactograph.graph import load
>>> pipeline = load("reconstruct", calibration="cal.npz")  # doctest: +SKIP
>>> height = pipeline(frames=stack)["height"]  # doctest: +SKIP
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from tactograph.graph.declare.declare_node import node as node
from tactograph.graph.declare.engine_arguments import (
    EVERYTHING as EVERYTHING,
    KeepIntegers as KeepIntegers,
    NodeCall as NodeCall,
    Session as Session,
    Wanted as Wanted,
)
from tactograph.graph.declare.node import Node as Node
from tactograph.graph.declare.ports import NamedPorts as NamedPorts, Port as Port
from tactograph.graph.declare.provenance import Provenance as Provenance
from tactograph.graph.declare.size_rules import SizeLimit as SizeLimit, SizeRule as SizeRule
from tactograph.graph.declare.tolerance import Close as Close
from tactograph.graph.errors import (
    EndOfStream as EndOfStream,
    GraphError as GraphError,
    InputError as InputError,
    NodeError as NodeError,
    TactographError as TactographError,
    warn as warn,
)

if TYPE_CHECKING:
    from tactograph.graph.backends import parity as parity
    from tactograph.graph.cache.cache import Cache as Cache
    from tactograph.graph.run.open_pipeline import load as load
    from tactograph.graph.run.pipeline import Pipeline as Pipeline

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
