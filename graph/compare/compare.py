"""Comparisons: every variant on every capture, back end, swept value and seed, kept on disk.

Nothing here knows optics: a row holds the figures among a graph's outputs.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from itertools import product
from pathlib import Path
from statistics import fmean
from typing import Any

from tactograph.graph.cache.cache import Cache
from tactograph.graph.cache.result_origin import find_origin
from tactograph.graph.compare.stored_views import save_views, views_of
from tactograph.graph.compare.sweep import Sweep, check_targets, points, seed_like, seeds
from tactograph.graph.disk.atomic_files import atomic_files
from tactograph.graph.errors import InputError, TactographError, WriteError
from tactograph.graph.files.changes import with_changes
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.plan.plan import Step
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.graph.run.result import Result

REPEATS_PER_ITEM = 3
"""How often an item is computed, for the median of its times."""


@dataclass(frozen=True)
class Study:
    """The settings that determine the runs of a comparison; `values` are ``name=value`` words."""

    graphs: Sequence[Graph]
    values: Sequence[str] = ()
    captures: Sequence[Path] = ()
    backends: Sequence[str | None] = (None,)
    device: str | None = None
    sweeps: Sequence[Sweep] = ()
    seed: str | None = None
    repeats: int = 1

    @cached_property
    def arguments(self) -> dict[str, dict[str, Any]]:
        """The values of each graph's params, by its name, as `Graph.read_words` reads them."""
        return {graph.name: graph.read_words(self.values) for graph in self.graphs}

    def check(self) -> None:
        """Refuse a comparison that cannot be run.

        Raises InputError if a sweep or seed names nothing, captures are missing, or repeats would
        all be the same.
        """
        targets = [sweep.target for sweep in self.sweeps]
        check_targets(self.graphs, targets, "--sweep")
        check_targets(self.graphs, [self.seed] if self.seed else [], "--seed")
        if len({*targets, self.seed}) < len([*targets, self.seed]):
            raise InputError("a parameter can be swept, or be the seed, only once")
        if self.repeats > 1 and self.seed is None:
            choices = ", ".join(seed_like(self.graphs)) or "no node has one"
            raise InputError(f"--repeats needs --seed node.param to vary (seeds: {choices})")
        for graph in self.graphs:
            if graph.capture_param and not self.captures:
                raise InputError(f"{graph.name} takes captures; give --over DIR")


@dataclass
class Row:
    """The result of one job: figures and times, or the error."""

    variant: str
    capture: str
    backend: str
    hash: str
    figures: dict[str, float] = field(default_factory=dict)
    milliseconds: dict[str, float] = field(default_factory=dict)
    backends: dict[str, str] = field(default_factory=dict)
    device: str | None = None
    error: str = ""
    fallbacks: list[str] = field(default_factory=list)
    sweep: dict[str, Any] = field(default_factory=dict)
    seed: int | None = None
    origin: dict[str, Any] = field(default_factory=dict)
    items: int = 0
    warnings: list[str] = field(default_factory=list)

    @property
    def key(self) -> tuple[str, ...]:
        """The identity of this run in its comparison."""
        return (self.variant, self.capture, self.backend, repr(self.sweep), repr(self.seed))

    @property
    def label(self) -> str:
        """The run in words, for people."""
        on = f"on {self.capture}" if self.capture else ""
        return " ".join(filter(None, [self.variant, on, *self._swept, *self._seeded]))

    def folder(self, out: Path) -> Path:
        """The folder of the run's results, below that of the comparison."""
        parts = [self.variant, self.backend, self.capture, ",".join(self._swept), *self._seeded]
        return out.joinpath(*(part.replace("/", "_") for part in parts if part))

    @property
    def _swept(self) -> list[str]:
        return [f"{target}={value}" for target, value in self.sweep.items()]

    @property
    def _seeded(self) -> list[str]:
        return [] if self.seed is None else [f"seed={self.seed}"]


@dataclass(frozen=True)
class Job:
    """A run of the comparison: a graph, changed as its row says, on a capture."""

    graph: Graph
    backend: str | None
    capture: Path | None
    row: Row


def make_jobs(study: Study) -> list[Job]:
    """Make all combinations, capture by capture, so that related rows are neighbours.

    Raises InputError if two of them would write into the same folder.
    """
    jobs: dict[Path, Job] = {}
    for capture, graph in product((None, *study.captures), study.graphs):
        if bool(graph.capture_param) != (capture is not None):
            continue
        name = "" if capture is None else capture.resolve().name
        all_seeds = seeds(graph, study.seed, study.repeats, study.arguments[graph.name])
        for backend, point, seed in product(study.backends, points(graph, study.sweeps), all_seeds):
            changed = with_changes(graph, {**point, **seed})
            row = Row(graph.name, name, backend or "preferred", changed.hash, sweep=point)
            row.seed = next(iter(seed.values()), None)
            folder = row.folder(Path())
            if folder in jobs:
                raise InputError(f"two runs are called {folder}; give them different names")
            jobs[folder] = Job(changed, backend, capture, row)
    return [*jobs.values()]


def run_job(job: Job, study: Study, out: Path, cache: Cache) -> tuple[Row, bool]:
    """Run one job, or take its row from an earlier run with the same key.

    Nodes whose results are in `cache` from another job do not run again.  Returns the row, and
    whether it is from an earlier run.
    """
    row, folder = job.row, job.row.folder(out)
    values = {**study.arguments[job.graph.name], **_places(job, folder)}
    try:
        row.origin = find_origin(job.graph, values, backend=job.backend, device=study.device)
        if (done := _done(folder, row)) is not None:
            return done, True
        results = _run(job, values, study.device, row, cache)
    except WriteError:
        raise  # no other run can be kept either
    except Exception as error:  # it must not end the other runs
        is_ours = isinstance(error, TactographError)
        row.error = str(error) if is_ours else f"{type(error).__name__}: {error}"
        return row, False
    with atomic_files(folder) as stage:
        save_views(views_of(results), stage)
        (stage / "row.json").write_text(json.dumps(asdict(row), indent=1) + "\n")
    return row, False


def _run(job: Job, values: Mapping[str, Any], device: str | None, row: Row, cache: Cache) -> Result:
    """Run all items, enter them into the row, and return the first for its pictures."""
    pipeline = open_pipeline(job.graph, values, backend=job.backend, device=device, cache=cache)
    first: Result | None = None
    figures: dict[str, list[float]] = {}
    times: dict[str, list[float]] = {}
    for result in pipeline.items(repeats=REPEATS_PER_ITEM):
        first = first or result
        for name, figure in result.figures.items():
            figures.setdefault(name, []).append(float(figure))
        # Only steps that compute an item count, not those that read, write or rate it, or run once.
        for step in _computing(result):
            if step.stream:
                times.setdefault(step.name, []).append(result.times.get(step.name, 0.0))
        row.items += 1
        row.warnings = list(dict.fromkeys([*row.warnings, *result.warnings]))
    if first is None:
        raise InputError(f"{job.graph.name} yielded nothing")
    row.warnings = list(dict.fromkeys([*row.warnings, *pipeline.closing_warnings]))
    row.figures = {name: fmean(many) for name, many in figures.items()}
    row.milliseconds = {name: fmean(many) for name, many in times.items()}
    row.backends = {step.name: step.backend for step in _computing(first)}
    row.device = first.plan.device
    row.fallbacks = first.plan.fallbacks
    return first


def _computing(result: Result) -> list[Step]:
    """The transfers, and the nodes that compute arrays or numbers from others."""
    nodes = {name: task.node for name, task in result.plan.tasks.items()}
    kinds = {name: {port.kind for port in node.outputs.values()} for name, node in nodes.items()}
    others = {name for name, node in nodes.items() if node.source or kinds[name] <= {"object"}}
    return [step for step in result.plan.steps if step.name not in others]


def _places(job: Job, folder: Path) -> dict[str, str]:
    """The places of the capture and of the results, for params that the graph has."""
    places = {"out": str(folder)}
    if job.capture is not None:
        places |= job.graph.at_capture(job.capture)
    return {name: place for name, place in places.items() if name in job.graph.params}


def _done(folder: Path, job: Row) -> Row | None:
    try:
        row = Row(**json.loads((folder / "row.json").read_text()))
    except (OSError, ValueError, TypeError):
        return None
    return row if row.origin == job.origin else None
