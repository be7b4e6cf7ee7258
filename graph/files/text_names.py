"""Names of files that are text: others cannot be written down, and end some libraries at once."""

from __future__ import annotations

from pathlib import Path

from tactograph.graph.errors import InputError


def refuse_other_names(place: str | Path) -> None:
    """Refuse a place whose name holds bytes that are not UTF-8.

    Raises
    ------
    InputError
        With the name as far as it can be shown.
    """
    try:
        str(place).encode()
    except UnicodeEncodeError:
        raise InputError(f"{str(place)!r}: the name is not UTF-8; rename it") from None
