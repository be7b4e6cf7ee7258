"""The warnings of many runs in few lines."""

from collections.abc import Iterable

from tactograph.graph.errors import a_few

MAX_WARNINGS = 3
"""Different warnings that are printed; the table has all."""


def warning_lines(
    warned: Iterable[tuple[str, Iterable[str]]], most: int | None = MAX_WARNINGS
) -> list[str]:
    """Write each warning once, with its first place and the number of others.

    After the `most` first, if that is not None, a line counts the others.
    """
    places: dict[str, list[str]] = {}
    for place, warnings in warned:
        for text in warnings:
            places.setdefault(text, []).append(place)
    lines = [_line(text, where) for text, where in places.items()]
    if most is None or len(lines) <= most:
        return lines
    return [*lines[:most], f"warning: {len(lines) - most} more, see the table"]


def _line(text: str, places: list[str]) -> str:
    # Many warnings begin with the place.
    if len(places) == 1 and text.startswith(places[0]):
        return f"warning: {text}"
    return f"warning: {a_few(places, 1)}: {text}"
