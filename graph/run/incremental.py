"""The executor that runs only what changed: the steps whose results are not in the cache.

A node's run has a key: the node, its back end and device, its settings and the keys of its inputs.
Runs with equal keys are computed once.  A node that looks outside (a source, or a node that keeps a
session or names a file) runs for every item; its key is the hash of its outputs.

One walk goes through the steps in order.  A step runs if its key is new.  What it reads, and the
targets of the walk, come from the cache, or are computed again if the cache has dropped them.
"""

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from statistics import median
from typing import Any

from tactograph.graph.backends.arrays import DeviceArray
from tactograph.graph.cache.cache import Cache, CacheKey, Run
from tactograph.graph.cache.keys import content_key, key_of
from tactograph.graph.errors import GraphNames, collect_warnings, warn
from tactograph.graph.plan.draft import Task, Value
from tactograph.graph.plan.feeds import feed_of
from tactograph.graph.plan.plan import Step
from tactograph.graph.plan.sizes import Bounds
from tactograph.graph.plan.spots import Spot, put_out, read_by, recalled_by, written_by
from tactograph.graph.run.executor import Executor, Outputs, Part, Yields, part_of
from tactograph.graph.run.integer_images import in_fractions
from tactograph.graph.run.ownership import lent
from tactograph.graph.run.step_runner import StepRunner


class OnlyChanged(Executor):
    """Runs the steps whose results are not in the cache."""

    def __init__(self, runner: StepRunner, cache: Cache) -> None:
        super().__init__(runner)
        self._plan, self._cache = runner.plan, cache
        self._once = part_of(self._plan, stream=False).computing
        self._maker = {spot: step for step in self._plan.steps for spot in written_by(step)}
        self._recalled = recalled_by(self._plan)
        self._has_item = False
        self._of_source: list[str] = []
        self._keys: dict[str, str] = {}
        """The key of each node's run for the present item."""
        self._outside: dict[str, str] = {}
        """The keys of nodes that look outside and have run."""
        self._settings: dict[str, str] = {}
        """Each node's settings as text, a part of its key."""
        self._runs: dict[str, Run] = {}
        """The shapes, times and warnings of runs with the present keys."""
        self._here: dict[Spot, str] = {}
        """The key of the value that lies at a spot."""
        self._before: dict[Value, str] = {}
        """The keys of the values that this item recalls."""
        self._needs: dict[tuple[Spot, ...], set[str]] = {}
        self._sizes: dict[str, Bounds] = {}
        """The sizes that are known before each step."""
        self._captured: list[tuple[Spot, CacheKey]] = []
        self._ran: set[str] = set()
        self._to_repeat: set[str] = set()
        self._targets: dict[str, set[Spot]] = {}
        """The targets of the walk, by the step that writes them."""
        self._yields: Yields = {}

    def begin(self, *, same_item: bool) -> None:
        tasks = self._plan.tasks
        if not same_item:
            if self._has_item:  # which from now on cannot be run again
                # A value that a failed attempt left incomplete equals no other.
                self._before = {
                    spot.value: self._here.get(spot) or content_key(object())
                    for spot in self._recalled
                }
                super().end()
            self._has_item = False
            self._outside = {n: key for n, key in self._outside.items() if not tasks[n].stream}
            self._of_source = list(self._runner.notes)
        self._here = {
            spot: key
            for spot, key in self._here.items()
            if not tasks[spot.value.node].stream or spot.value.node in self._outside
        }
        self._keys = {}

    def compute(
        self, part: Part, yields: Yields, outputs: Outputs, repeats: int
    ) -> tuple[Bounds, float]:
        if not part.stream and not part.sinks:
            return {}, 0.0  # computed when an item needs it
        steps = [*self._once, *part.computing] if part.stream else part.computing
        names = {step.name for step in steps}
        targets = [put_out(self._plan, v) for v in outputs.values() if v.node in names]
        targets += [spot for step in part.sinks for spot in read_by(self._plan, step)]
        targets += self._recalled if part.stream else []
        needed = self._needed(tuple(targets))
        steps = [step for step in steps if step.name in needed]
        start = time.perf_counter()
        try:
            bounds = self._make(steps, targets, yields, repeats)
        finally:
            self._settle()
        total = 1e3 * (time.perf_counter() - start)
        self._tell_warnings()
        self.reused = frozenset(step.name for step in steps if step.name not in self._ran)
        return bounds, total

    def end(self) -> None:
        self._has_item = True

    def changed(self, node: str) -> None:
        # A node that looks outside has to run again.
        self._outside.pop(node, None)
        self._settings.pop(node, None)

    def forget(self) -> None:
        super().forget()
        self._keys, self._before, self._has_item = {}, {}, False

    def inspect(self, value: Value) -> Any:
        """A value of the last item, computed again if it was dropped."""
        plan = self._plan
        if value not in plan.inspected:
            plan.inspect(value)
            if self._runner.device is not None:
                self._runner.device.drop_launch(value.node)
        on_host = Spot(value, "host")
        spot = on_host if on_host in self._maker else Spot(value, "device")
        with collect_warnings([]):
            steps = [*self._once, *part_of(plan, stream=True).computing]
            self._make(steps, [spot], {}, 1)
        # If no node reads it, it was released on the device at once.
        cached = CacheKey(self._keys[value.node], value.port, spot.side)
        values = self._runner.side(spot.side)
        content = self._cache.take(cached) if cached in self._cache else values.get(value)
        if isinstance(content, DeviceArray) and self._runner.device is not None:
            content = self._runner.device.download(content)
        self._settle()
        return lent(in_fractions(plan.tasks[value.node], content))

    def _make(self, steps: list[Step], targets: list[Spot], yields: Yields, repeats: int) -> Bounds:
        """Compute the targets; return the sizes that are known behind the steps.

        A step that does not run has the time of its last run.
        """
        self._targets, self._yields = {}, yields
        for spot in targets:
            self._targets.setdefault(self._maker[spot].name, set()).add(spot)
        self._captured, self._ran, self._to_repeat = [], set(), set()
        times, bounds = self._runner.times, {}
        runs: list[dict[str, float]] = []
        try:
            for _ in range(repeats):
                bounds = self._runner.walk(steps, {}, self._take)
                runs.append({name: times[name] for name in self._ran if name in times})
                self._to_repeat = {s.name for s in steps if s.stream} & self._ran
        except BaseException:
            for spot, cached in self._captured:  # its value may be incomplete
                self._cache.drop(cached)
                self._here.pop(spot, None)
            raise
        for step in steps:
            if step.name in self._ran:
                if timed := [run[step.name] for run in runs[1:] or runs if step.name in run]:
                    times[step.name] = median(timed)
                if not step.is_transfer:
                    self._note(step.name)
            elif step.name in self._runs:
                times[step.name] = self._runs[step.name].milliseconds
            elif step.is_transfer:
                times.pop(step.name, None)
        return bounds

    def _take(self, step: Step, bounds: Bounds) -> Bounds:
        """Run a step or pass over it, and bring those targets that it writes."""
        self._sizes[step.name] = bounds
        if self._must_run(step):
            bounds = self._execute(step)
        else:
            shapes = self._runs[step.name].shapes if step.name in self._plan.tasks else {}
            bounds = self._runner.pass_over(step, bounds, shapes)
        for spot in self._targets.get(step.name, ()):
            self._bring(spot)
        return bounds

    def _must_run(self, step: Step) -> bool:
        """Return whether a step's result is new; note its key if it is a node."""
        task = self._plan.tasks.get(step.name)
        if task is None:
            # If a value is new, so are its readers: begin its transfer before they need it.
            return step.reads[0].node in self._ran
        if task.looks_outside:
            if step.name in self._outside:
                self._lies_here(step, self._outside[step.name])
            return step.name not in self._outside
        key = self._keys[step.name] = self._key(task, step)
        run = self._cache.run(key)
        if run is not None:
            self._runs[step.name] = run
        return run is None or step.name in self._to_repeat

    def _lies_here(self, step: Step, key: str) -> None:
        """Note the key of a node that looks outside; its values stay where they are."""
        self._keys[step.name] = key
        self._here |= dict.fromkeys(written_by(step), key)

    def _bring(self, spot: Spot) -> None:
        """Bring the present item's value to a spot."""
        key = self._keys[spot.value.node]
        cached = CacheKey(key, spot.value.port, spot.side)
        if self._here.get(spot) == key:
            return
        if cached in self._cache:
            self._here[spot] = key
            self._runner.side(spot.side).put(spot.value, self._cache.take(cached))
        else:
            self._execute(self._maker[spot])

    def _note(self, name: str) -> None:
        """Tell the cache how long a node's run took."""
        took = self._runner.times.get(name, 0.0)
        run = self._runs[name] = replace(self._runs[name], milliseconds=took)
        self._cache.note(self._keys[name], run)

    def _execute(self, step: Step) -> Bounds:
        """Run one step, and put its outputs into the cache."""
        for spot in read_by(self._plan, step):
            self._bring(spot)
        warnings: list[str] = []
        with collect_warnings(warnings, marked=True):
            bounds = self._runner.execute(step, self._sizes[step.name], self._yields)
        self._capture(step, warnings)
        for value in step.release:
            self._here.pop(Spot(value, "device"), None)
        self._runner.release(step)
        self._ran.add(step.name)
        return bounds

    def _capture(self, step: Step, warnings: Sequence[str]) -> None:
        """Put those outputs of a step into the cache that its node was asked for."""
        task = self._plan.tasks.get(step.name)
        if task is not None:
            shapes = dict(self._runner.shapes_of(step))
            self._runs[step.name] = Run(shapes, 0.0, tuple(warnings))
            if task.looks_outside:
                results = [self._runner.host[value] for value in step.writes]
                self._outside[step.name] = content_key(*results)
                self._lies_here(step, self._outside[step.name])
                return
        asks = task is not None and task.node.wanted is not None
        for spot in written_by(step):
            if asks and spot.value.port not in self._plan.wanted[step.name]:
                continue
            cached = CacheKey(self._keys[spot.value.node], spot.value.port, spot.side)
            self._here[spot] = cached.run
            self._captured.append((spot, cached))
            self._cache.put(cached, self._runner.side(spot.side).get(spot.value))

    def _needed(self, targets: tuple[Spot, ...]) -> set[str]:
        """The names of the steps that the targets depend on."""
        if targets in self._needs:
            return self._needs[targets]
        needed = self._needs[targets] = set[str]()
        waiting = list(targets)
        while waiting:
            step = self._maker[waiting.pop()]
            if step.name not in needed:
                needed.add(step.name)
                waiting.extend(read_by(self._plan, step))
        return needed

    def _settle(self) -> None:
        """Release this item's values on the device; the cache holds what is kept."""
        device = self._runner.device
        stays = {spot for spot in self._recalled if spot.side == "device"}
        stays |= {Spot(value, "device") for value in self._plan.stays}
        for spot in [s for s in self._here if s.side == "device" and s not in stays]:
            if self._plan.tasks[spot.value.node].stream and device is not None:
                device.drop([spot.value])
                del self._here[spot]

    def _tell_warnings(self) -> None:
        """Repeat the warnings of all nodes, including those whose results come from the cache."""
        self._runner.notes[:] = self._of_source
        for step in self._plan.steps:
            run = self._runs.get(step.name) if step.name in self._keys else None
            for warning in run.warnings if run is not None else ():
                with GraphNames(partial(feed_of, self._plan, self._plan.tasks[step.name])):
                    warn(warning)

    def _key(self, task: Task, step: Step) -> str:
        node, device = task.node, self._runner.device
        calls = self._plan.placements[task.id].calls
        # A size that no input gives depends on the sources.
        outside = self._outside.items() if task.filled or node.free_symbols else ()
        reads = {} if task.filled else task.reads
        if task.id not in self._settings:
            self._settings[task.id] = repr(sorted(task.settings.items()))
        return key_of(
            node.serial,
            device.serial if device is not None and (step.on_device or calls) else "",
            step.kind,
            self._settings[task.id],
            [(name, self._keys[value.node], value.port) for name, value in reads.items()],
            [(self._keys[value.node], value.port) for value in task.conditions],
            self._keys[task.instead] if task.instead is not None else "",
            [(name, self._before.get(value)) for name, value in task.recalls.items()],
            sorted((n, key) for n, key in outside if n in self._keys),
        )
