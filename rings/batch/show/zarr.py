"""The content of a batch's store."""

from collections import Counter
from pathlib import Path

from tactograph.rings.batch.entry import DONE, PENDING
from tactograph.rings.export.summary import Summary, first, input_files, param_line, section
from tactograph.sdk import InputError, need


def show(file: Path) -> Summary:
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
    lines = [
        f"{file}: store of a batch by graph {store.graph} [{store.identity['hash']}]",
        f"captures: {len(entries)}, done {status[DONE]}, failed {failed}, "
        f"pending {status[PENDING]}",
        *param_line(store.arguments),
        *input_files(store.inputs),
        f"maps: {', '.join(store.types) or 'none'}",
        *section("failed", first(reasons)),
        *section("warnings", first([f"  {n} x {text}" for text, n in warned.most_common()])),
    ]
    return Summary(lines)
