"""The content of a batch's store."""

from collections import Counter
from pathlib import Path

from tactograph.rings.batch.entry import DONE, PENDING
from tactograph.sdk import InputError, Shown, need

MAX_LINES = 20
"""Most failures, and most different warnings, that are printed."""


def show(file: Path) -> Shown:
    """Return how many captures are done, failed or pending, the maps, reasons and warnings.

    Raises
    ------
    InputError
        If there is no store of a batch, or it is damaged.
    """
    need("batch", "a batch", "zarr", "numcodecs")
    from tactograph.rings.batch.store import open_store

    store = open_store(str(file))
    if store is None:
        raise InputError(f"{file}: no store of a batch")
    names, entries = store.captures, store.read_all()
    status = Counter(entry.status for entry in entries)
    failed = len(entries) - status[DONE] - status[PENDING]
    warned = Counter(warning for entry in entries for warning in entry.warnings)
    runs = zip(names, entries, strict=True)
    reasons = [f"  {name}: {e.reason}" for name, e in runs if e.status not in (DONE, PENDING)]
    params = [f"{name}={value}" for name, value in store.arguments.items() if value is not None]
    lines = [
        f"{file}: store of a batch by graph {store.graph} [{store.identity['hash']}]",
        f"captures: {len(entries)}, done {status[DONE]}, failed {failed}, "
        f"pending {status[PENDING]}",
        f"params: {' '.join(params)}",
        *(
            f"{name}: {', '.join(f'{key} {text}' for key, text in about.items())}"
            for name, about in store.inputs.items()
        ),
        f"maps: {', '.join(store.types) or 'none'}",
        *_section("failed", reasons),
        *_section("warnings", [f"  {n} x {text}" for text, n in warned.most_common()]),
    ]
    return Shown(lines, {})


def _section(title: str, lines: list[str]) -> list[str]:
    more = len(lines) - MAX_LINES
    rest = [f"  … and {more} more"] if more > 0 else []
    return [f"{title}:", *lines[:MAX_LINES], *rest] if lines else []
