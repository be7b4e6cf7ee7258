"""The lines and pictures that are shown of a file."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

MAX_LINES = 20
"""Most failures, and most sentences of a kind, that are printed."""


class Summary(NamedTuple):
    """Lines to print, and functions that draw a picture into a file of that name."""

    lines: list[str]
    pictures: Mapping[str, Callable[[Path], None]] = {}


def figures(values: Mapping[str, float]) -> list[str]:
    """Return a line for each figure: counts in full, measurements to four digits."""
    width = max(map(len, values), default=0)
    return [
        f"  {name:<{width}}  {int(v) if float(v).is_integer() else format(v, '.4g')}"
        for name, v in values.items()
    ]


def section(title: str, lines: Iterable[str]) -> list[str]:
    """Return a titled section; nothing if it has no lines."""
    inside = list(lines)
    return [f"{title}:", *inside] if inside else []


def first(lines: list[str]) -> list[str]:
    """Return the first `MAX_LINES` lines, and how many more there are."""
    more = len(lines) - MAX_LINES
    return lines[:MAX_LINES] + ([f"  … and {more} more"] if more > 0 else [])


def sentences(values: Any) -> list[str]:
    """Return the strings of a value that should be a list of them, a line each."""
    lines = values if isinstance(values, list) else []
    return [f"  {line}" for line in lines if isinstance(line, str)]


def origin(provenance: Any) -> list[str]:
    """Return where a file comes from: graph, params and versions of its `Provenance`."""
    provenance = provenance if isinstance(provenance, dict) else {}
    graph, params, versions = (
        part if isinstance(part := provenance.get(name), dict) else {}
        for name in ("graph", "arguments", "versions")
    )
    lines = [f"made by: graph {graph['name']} [{graph.get('hash', '')}]"] if "name" in graph else []
    if "tactograph" in versions:
        lines[-1:] = [f"{line}, version {versions['tactograph']}" for line in lines[-1:]]
    return [*lines, *param_line(params), *input_files(provenance.get("inputs"))]


def input_files(inputs: Any) -> list[str]:
    """Return a line for each file that a graph was given: its sensor, date and hash."""
    files = inputs.items() if isinstance(inputs, dict) else ()
    return [
        f"{name}: {', '.join(f'{key} {text}' for key, text in identity.items())}"
        for name, identity in files
        if isinstance(identity, dict) and identity
    ]


def param_line(values: Mapping[str, Any]) -> list[str]:
    """Return a line of the params that were given; nothing if there were none."""
    params = [f"{name}={value}" for name, value in values.items() if value is not None]
    return [f"params: {' '.join(params)}"] if params else []
