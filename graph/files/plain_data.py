"""Graphs that a program gives as plain data, in the form of a parsed YAML file."""

import os
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

from tactograph.graph.disk.strict_yaml import MAX_DEPTH, Document, Path_, Place, dotted
from tactograph.graph.errors import GraphError, printable

_ENGINE_PACKAGE = "tactograph.graph"


def as_document(data: Mapping[str, Any]) -> Document:
    """Make a document of the data; its place is the line of the program that hands it over.

    Raises GraphError if the data contains anything that a graph file could not.
    """
    places: dict[Path_, Place] = {}
    return Document(_plain(data, (), _handed_over(), places), places)


def _handed_over() -> str:
    """File and line, or cell and line, of the caller outside this package."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith(
        _ENGINE_PACKAGE
    ):
        frame = frame.f_back
    return f"{_cell(frame.f_code.co_filename)}:{frame.f_lineno}"


def _cell(file: str) -> str:
    """Name a cell as IPython does in its messages; leave other files as they are."""
    interactive = sys.modules.get("IPython")
    shell = interactive.get_ipython() if interactive is not None else None
    name = getattr(getattr(shell, "compile", None), "format_code_name", lambda _: None)(file)
    return " ".join(name) if name else file


def _plain(value: Any, path: Path_, file: str, places: dict[Path_, Place]) -> Any:
    place = places[path] = Place(file, 0, 0, dotted(path))
    if len(path) > MAX_DEPTH:
        raise GraphError(f"{place}: nested too deeply for a graph")
    if isinstance(value, Mapping):
        for key in value:
            if not isinstance(key, str):
                raise GraphError(f"{place}: the key {key!r} is no text")
        return {key: _plain(v, (*path, key), file, places) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v, (*path, i), file, places) for i, v in enumerate(value)]
    if isinstance(value, np.generic):
        return _plain(value.item(), path, file, places)
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, str) and printable(value) != value:
        raise GraphError(f"{place}: control characters are not allowed in text")
    if value is None or isinstance(value, str | bool | int | float):
        return value
    raise GraphError(f"{place}: a {type(value).__name__} is not plain data")
