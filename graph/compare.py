"""Every variant on every capture on every back end, and the table that comes of it.

Nothing here knows optics: a row holds whatever figures a graph's outputs hold.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from tactograph.graph.errors import InputError, TactographError
from tactograph.graph.model import Graph
from tactograph.graph.run import Result, open_pipeline
from tactograph.graph.whole import whole_files

REPEATS = 3


@dataclass(frozen=True)
class Job:
    """One cell of the comparison."""

    graph: Graph
    backend: str | None
    capture: Path

    def folder(self, out: Path) -> Path:
        return out / self.graph.name / (self.backend or "preferred") / self.capture_name

    @property
    def capture_name(self) -> str:
        return self.capture.resolve().name


@dataclass
class Row:
    """What one job gave: figures and times, or the reason why there are none."""

    variant: str
    capture: str
    backend: str
    hash: str
    figures: dict[str, float] = field(default_factory=dict)
    milliseconds: dict[str, float] = field(default_factory=dict)
    backends: dict[str, str] = field(default_factory=dict)
    device: str | None = None
    error: str = ""
    given: dict[str, str] = field(default_factory=dict)
    fallbacks: list[str] = field(default_factory=list)


def make_jobs(
    graphs: Sequence[Graph], captures: Sequence[Path], backends: Sequence[str | None]
) -> list[Job]:
    """All combinations, variant by variant, so that neighbours in the table belong together.

    Raises
    ------
    InputError
        If two of them would write into the same folder.
    """
    jobs = [
        Job(graph, backend, capture)
        for capture in captures
        for graph in graphs
        for backend in backends
    ]
    taken: set[Path] = set()
    for job in jobs:
        folder = job.folder(Path())
        if folder in taken:
            raise InputError(f"two of the runs are called {folder}; give them different names")
        taken.add(folder)
    return jobs


def run_job(job: Job, given: Mapping[str, Any], out: Path, device: str | None) -> Row:
    """Run one job, or take its row from a former run of the very same graph and values."""
    folder = job.folder(out)
    values = {
        **given,
        **{name: value for name, value in _places(job, folder).items() if name in job.graph.params},
    }
    words = {name: str(value) for name, value in values.items()}
    done = _done(folder, job, words)
    if done is not None and (device or "").lower() in (done.device or "").lower():
        return done
    row = Row(
        job.graph.name, job.capture_name, job.backend or "preferred", job.graph.hash, given=words
    )
    try:
        pipeline = open_pipeline(job.graph, values, backend=job.backend, device=device)
        for result in pipeline.items(repeats=REPEATS):
            _enter(row, result)
    except Exception as error:  # whatever it is, it must not end the other runs
        known = isinstance(error, TactographError)
        row.error = str(error) if known else f"{type(error).__name__}: {error}"
        return row
    with whole_files(folder) as stage:
        (stage / "row.json").write_text(json.dumps(asdict(row), indent=1) + "\n")
    return row


def write_tables(rows: Sequence[Row], out: Path) -> None:
    """Write ``table.csv`` and ``table.json``."""
    figures = _columns(row.figures for row in rows)
    with whole_files(out) as stage:
        with (stage / "table.csv").open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(["variant", "capture", "backend", *figures, "ms", "hash", "error"])
            for row in rows:
                values = [row.figures.get(name, "") for name in figures]
                total = sum(row.milliseconds.values()) if row.milliseconds else ""
                writer.writerow(
                    [row.variant, row.capture, row.backend, *values, total, row.hash, row.error]
                )
        text = json.dumps([asdict(row) for row in rows], indent=1)
        (stage / "table.json").write_text(text + "\n")


def print_table(rows: Sequence[Row], echo: Callable[[str], None]) -> None:
    """Print the figures on the terminal, the best value of each capture marked with a star."""
    from rich.console import Console
    from rich.table import Table

    figures = _columns(row.figures for row in rows)
    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in ("capture", "variant", "back end"):
        table.add_column(heading)
    for heading in (*figures, "ms"):
        table.add_column(heading, justify="right", overflow="fold")
    for row in rows:
        cells = [_cell(row, name, rows) for name in figures]
        total = f"{sum(row.milliseconds.values()):.1f}" if row.milliseconds else ""
        table.add_row(row.capture, row.variant, _where(row), *cells, total)
    console = Console(width=160, highlight=False, markup=False)
    with console.capture() as captured:
        console.print(table)
    echo(captured.get().rstrip())
    for row in rows:
        if row.error:
            echo(f"failed: {row.variant} on {row.capture}: {row.error}")
    for line in dict.fromkeys(f"{row.variant}: {line}" for row in rows for line in row.fallbacks):
        echo(f"fallback: {line}")


def _places(job: Job, folder: Path) -> dict[str, Any]:
    return {"capture": str(job.capture), "out": str(folder)}


def _done(folder: Path, job: Job, words: dict[str, str]) -> Row | None:
    file = folder / "row.json"
    try:
        row = Row(**json.loads(file.read_text()))
    except (OSError, ValueError, TypeError):
        return None
    return row if (row.hash, row.given) == (job.graph.hash, words) else None


def _enter(row: Row, result: Result) -> None:
    for value in result.outputs.values():
        if isinstance(value, dict):
            row.figures.update({name: float(figure) for name, figure in value.items()})
    for step in result.plan.steps:
        task = result.plan.tasks.get(step.name)
        if not step.stream or (task is not None and (task.node.source or task.node.sink)):
            continue
        row.milliseconds[step.name] = result.times.get(step.name, 0.0)
        row.backends[step.name] = step.backend
    row.device = result.plan.device
    row.fallbacks = result.plan.fallbacks


def _columns(many: Iterable[Mapping[str, float]]) -> list[str]:
    seen: dict[str, None] = {}
    for figures in many:
        seen.update(dict.fromkeys(figures))
    return list(seen)


def _where(row: Row) -> str:
    return " + ".join(sorted(set(row.backends.values()))) or row.backend


def _cell(row: Row, name: str, rows: Sequence[Row]) -> str:
    if name not in row.figures:
        return ""
    peers = [r.figures[name] for r in rows if r.capture == row.capture and name in r.figures]
    best = abs(row.figures[name]) == min(map(abs, peers)) and len(set(peers)) > 1
    return f"{row.figures[name]:.4g}{'*' if best else ' '}"
