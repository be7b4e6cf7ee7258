"""The content of a result's folder."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from tactograph.rings.export.summary import Summary, figures, first, origin, section, sentences
from tactograph.sdk import InputError, StoredResult


def show_result(file: Path) -> Summary:
    """Return origin, figures and warnings of a ``result.json``.

    Raises
    ------
    InputError
        If the file is damaged, or no result.
    """
    try:
        result = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{file}: cannot be read: {error}") from None
    if not isinstance(result, dict) or not isinstance(result.get("graph"), dict):
        raise InputError(f"{file}: not a result of this program")
    metrics = result.get("metrics")
    numbers = metrics if isinstance(metrics, dict) else {}
    warnings = sentences(result.get("warnings"))
    stored = StoredResult(file, result)
    changed = [f"  {f.name}: {'changed' if f.is_file() else 'missing'}" for f in stored.changed]
    lines = [
        f"{file}: result",
        *origin(result),
        *(section("warnings", first(warnings)) or ["warnings: none"]),
        *section("figures", figures({n: v for n, v in numbers.items() if _is_number(v)})),
        *section(
            "layers", [f"  {name}: {', '.join(files)}" for name, files in stored.layers.items()]
        ),
        *section("not as they were written", first(changed)),
    ]
    return Summary(lines)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and bool(np.isfinite(value))
