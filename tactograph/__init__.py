"""Height maps in millimetres from optical touch sensors.

>>> from tactograph import load
>>> pipeline = load("reconstruct", calibration="cal.npz")  # doctest: +SKIP
>>> height = pipeline(frames=stack)["height"]  # doctest: +SKIP

The engine is `tactograph.graph`, the optics `tactograph.nodes`; both lie in folders of the
repository's top level, which pyproject.toml installs as parts of this package.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tactograph.graph.run.open_pipeline import load

    __version__: str

__all__ = ["__version__", "load"]


def __getattr__(name: str) -> Any:
    # A node file, or `tactograph --help`, needs neither.
    if name == "load":
        from tactograph.graph.run.open_pipeline import load

        return load
    if name == "__version__":
        from importlib.metadata import version

        return version("tactograph")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
