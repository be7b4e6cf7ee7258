"""Earlier times of a plan's steps: from a result, or from what ``bench`` wrote."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from tactograph.graph.errors import InputError
from tactograph.graph.plan.plan import Plan, Step

RESULT_FILE = "result.json"


class LastTimes(NamedTuple):
    """The file, and milliseconds by name of the step, of those that ran where they will now."""

    file: Path
    ms: Mapping[str, float]


def find_last_times(plan: Plan, place: Path, *, same_graph: bool) -> LastTimes | None:
    """Return the times in a file, or in a folder's newest result; None if there is no such file.

    Only times on the plan's device count, or on the host for a step of the host; with `same_graph`
    only those of a graph of this name.

    Raises InputError if the file is neither a result nor what ``bench`` wrote.
    """
    file = _newest(place) if place.is_dir() else place
    if file is None or not file.is_file():
        return None
    try:
        said = json.loads(file.read_text(encoding="utf-8"))
        runs = said if isinstance(said, list) else [said]
        if same_graph:
            runs = [run for run in runs if run["graph"]["name"] == plan.graph.name]
        known = {key: ms for run in runs for key, ms in _times(run)}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InputError(
            f"{file}: holds no times; give the folder of a result, or what 'bench --out' wrote"
        ) from None
    times = {step.name: known.get(_key(step, plan.device)) for step in plan.steps}
    return LastTimes(file, {name: ms for name, ms in times.items() if ms is not None})


def _newest(folder: Path) -> Path | None:
    """The result of a folder, or of the one that was written last in it."""
    own = folder / RESULT_FILE
    if own.is_file():
        return own
    files = folder.glob(f"*/{RESULT_FILE}")
    return max(files, key=lambda file: file.stat().st_mtime, default=None)


def _key(step: Step, device: str | None) -> tuple[str, str, str | None]:
    return step.name, step.backend, device if step.on_device else None


def _times(run: Mapping[str, Any]) -> list[tuple[tuple[str, str, str | None], float]]:
    return [
        (
            (node["node"], node["backend"], None if node["backend"] == "numpy" else run["device"]),
            float(node["ms"]),
        )
        for node in run["nodes"]
    ]
