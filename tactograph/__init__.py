"""Height maps in millimetres from optical touch sensors.

>>> from tactograph import load
>>> pipeline = load("reconstruct", calibration="cal.npz")  # doctest: +SKIP
>>> height = pipeline(frames=stack)["height"]  # doctest: +SKIP

The engine is `tactograph.graph`, the optics `tactograph.nodes`; both lie in folders of the
repository's top level, which are installed as parts of this package (setup.py).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tactograph.graph.run.open_pipeline import load

    __version__: str

__all__ = ["__version__", "load"]

# In a checkout the parts lie beside this folder; Python finds it first where it is started there.
if not (Path(__file__).parent / "graph").is_dir():
    __path__.append(str(Path(__file__).parents[1]))


def __getattr__(name: str) -> Any:
    # A node file, or `tactograph --help`, needs neither.
    if name == "load":
        from tactograph.graph.run.open_pipeline import load

        return load
    if name == "__version__":
        from importlib.metadata import version

        return version("tactograph")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
