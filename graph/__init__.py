"""The engine: graph files, ports, planning passes, back ends, running.

Of optics it knows only that images are lights x rows x columns.

>>> from tactograph.graph import load
>>> pipeline = load("reconstruct", calibration="cal.npz")  # doctest: +SKIP
>>> height = pipeline(frames=stack)["height"]  # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tactograph.graph.declare.declare_node import node
from tactograph.graph.declare.node import Node, Parts, SizeLimit, SizeRule
from tactograph.graph.declare.ports import Port
from tactograph.graph.declare.provenance import Provenance
from tactograph.graph.declare.session import Session
from tactograph.graph.declare.tolerance import Close, Exact, Flips
from tactograph.graph.declare.wanted_outputs import EVERYTHING, Wanted
from tactograph.graph.declare.whole_images import FRACTIONS, Whole
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
    from tactograph.graph.run.cache import Cache
    from tactograph.graph.run.open_pipeline import load
    from tactograph.graph.run.pipeline import Pipeline

__all__ = [
    "EVERYTHING",
    "FRACTIONS",
    "Cache",
    "Close",
    "EndOfStream",
    "Exact",
    "Flips",
    "GraphError",
    "InputError",
    "Node",
    "NodeError",
    "Parts",
    "Pipeline",
    "Port",
    "Provenance",
    "Session",
    "SizeLimit",
    "SizeRule",
    "TactographError",
    "Wanted",
    "Whole",
    "load",
    "node",
    "parity",
    "warn",
]


def __getattr__(name: str) -> Any:
    # The planner pulls in pydantic; a node file needs neither.
    if name == "load":
        from tactograph.graph.run.open_pipeline import load

        return load
    if name == "Cache":
        from tactograph.graph.run.cache import Cache

        return Cache
    if name == "parity":
        from tactograph.graph.backends import parity

        return parity
    if name == "Pipeline":
        from tactograph.graph.run.pipeline import Pipeline

        return Pipeline
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
