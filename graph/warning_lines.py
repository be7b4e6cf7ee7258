"""The warnings of many runs in few lines."""

from __future__ import annotations

from collections.abc import Iterable

MAX_LINES = 3
"""So many different warnings are printed; the table has all."""


def warning_lines(
    found: Iterable[tuple[str, Iterable[str]]], most: int | None = MAX_LINES
) -> list[str]:
    """Each warning once, with the first place that it is of and how many others there are.

    Parameters
    ----------
    found
        Places, each with its warnings.
    most
        How many are told, None for all; the last line counts those that are not.
    """
    places: dict[str, list[str]] = {}
    for place, warnings in found:
        for text in warnings:
            places.setdefault(text, []).append(place)
    lines = [_line(text, of) for text, of in places.items()]
    left = len(lines[most:]) if most is not None else 0
    return [*lines[:most], f"warning: {left} more, see the table"] if left else lines


def _line(text: str, places: list[str]) -> str:
    others = f" and {len(places) - 1} more" if len(places) > 1 else ""
    # Many begin with the place.
    of = "" if text.startswith(places[0]) and not others else f"{places[0]}{others}: "
    return f"warning: {of}{text}"
