"""Refuse file names that are not text: they cannot be recorded, and crash some libraries."""

from pathlib import Path

from tactograph.graph.errors import InputError


def refuse_other_names(place: str | Path) -> None:
    """Refuse a place whose name holds bytes that are not UTF-8.

    Raises InputError with the name, as far as it can be shown.
    """
    try:
        str(place).encode()
    except UnicodeEncodeError:
        raise InputError(f"{str(place)!r}: the name is not UTF-8; rename it") from None


def at_home(place: str) -> str:
    """A place with ``~`` expanded as a shell does.

    Raises InputError if there is no user ``~name``.
    """
    if not place.startswith("~"):
        return place
    try:
        return str(Path(place).expanduser())
    except RuntimeError:
        raise InputError(
            f"{place}: there is no such user; write ./{place} for a file of that name"
        ) from None
