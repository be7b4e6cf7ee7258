"""Executors: which steps of a plan run for an item, and how often."""

import time
from collections.abc import Mapping
from functools import partial
from statistics import median
from typing import Any, NamedTuple

from tactograph.graph.plan.draft import Value
from tactograph.graph.plan.plan import Plan, Step
from tactograph.graph.plan.sizes import Bounds
from tactograph.graph.run.step_runner import StepRunner

Yields = Mapping[str, Any]
"""The values that the stream's source yields, by node."""
Outputs = Mapping[str, Value]
"""Values by the names of the graph's outputs."""


class Part(NamedTuple):
    """The steps of a stream's item, or the steps outside the stream; sinks are listed apart."""

    stream: bool
    computing: list[Step]
    sinks: list[Step]


def part_of(plan: Plan, *, stream: bool) -> Part:
    """The part of a plan that runs for every item, or the part that runs once."""
    steps = [step for step in plan.steps if step.stream == stream]
    sinks = [s for s in steps if s.kind == "run" and plan.tasks[s.name].node.sink]
    return Part(stream, [step for step in steps if step not in sinks], sinks)


class Executor:
    """Computes the parts of a plan: once the part outside the stream, then each item.

    This executor runs every step of every item.  `reused` are the steps that did not run.
    """

    def __init__(self, runner: StepRunner) -> None:
        self._runner = runner
        self._behind_once: Bounds = {}
        self.reused: frozenset[str] = frozenset()

    def begin(self, *, same_item: bool) -> None:
        """Begin an item; with `same_item` it is the last one again, with the same source values."""

    def compute(
        self, part: Part, yields: Yields, outputs: Outputs, repeats: int
    ) -> tuple[Bounds, float]:
        """Compute the wanted outputs, and the values that the part's sinks read.

        `yields` are the values of the stream's source, by node.  With several `repeats` the times
        are medians over all repeats but the first.  Returns the sizes that are known behind the
        part, and the milliseconds of one run.
        """
        runner, before = self._runner, self._behind_once if part.stream else {}
        bounds = before
        runs: list[dict[str, float]] = []
        totals: list[float] = []
        for _ in range(repeats):
            start = time.perf_counter()
            bounds = runner.walk(part.computing, before, partial(self._run, yields=yields))
            totals.append(1e3 * (time.perf_counter() - start))
            if repeats > 1:
                runs.append(dict(runner.times))
        for name in runner.times if runs else ():
            runner.times[name] = median(run[name] for run in runs[1:])
        if not part.stream:
            self._behind_once = bounds
        return bounds, median(totals[1:] or totals)

    def end(self) -> None:
        """End an item that was computed and written."""
        # Now, as a caller may refill its arrays before the next item.
        for side in self._runner.sides:
            side.remember()

    def changed(self, node: str) -> None:
        """Note that the settings of a node changed."""

    def forget(self) -> None:
        """Treat the next item as the first."""
        for side in self._runner.sides:
            side.forget()

    def _run(self, step: Step, bounds: Bounds, *, yields: Yields) -> Bounds:
        bounds = self._runner.execute(step, bounds, yields)
        self._runner.release(step)
        return bounds
