"""The executor that runs only what changed: the steps of a plan whose results are not kept.

A node's run has a key: the node, its back end and device, its settings and the keys of its inputs.
Equal keys are computed once.  A node that looks outside (a source, or one that keeps a session or
names a file) runs for every item; its key is the content that it made.
"""

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from statistics import median
from typing import Any

from tactograph.graph.backends.arrays import DeviceArray
from tactograph.graph.cache.cache import Cache, Kept, Run
from tactograph.graph.cache.keys import content_key, key_of
from tactograph.graph.errors import GraphNames, collect_warnings, warn
from tactograph.graph.plan.draft import Task, Value
from tactograph.graph.plan.feeds import feed_of
from tactograph.graph.plan.plan import Step
from tactograph.graph.plan.sizes import Known
from tactograph.graph.plan.spots import Spot, put_out, read_by, recalled_by, written_by
from tactograph.graph.run.executor import Executor, Part, part_of
from tactograph.graph.run.ownership import lent
from tactograph.graph.run.step_runner import StepRunner
from tactograph.graph.run.whole_images import in_fractions


class OnlyChanged(Executor):
    """Runs the steps whose results are in no cache."""

    def __init__(self, runner: StepRunner, cache: Cache) -> None:
        super().__init__(runner)
        self._plan, self._cache = runner.plan, cache
        self._once = part_of(self._plan, stream=False).computing
        self._maker = {spot: step for step in self._plan.steps for spot in written_by(step)}
        self._recalled = recalled_by(self._plan)
        self._nothing: Known = {}
        self._has_item = False
        self._of_source: list[str] = []
        self._keys: dict[str, str] = {}
        """The key of each node's run for the present item."""
        self._outside: dict[str, str] = {}
        """The keys of nodes that look outside and have run."""
        self._runs: dict[str, Run] = {}
        """The shapes, times and warnings of runs with the present keys."""
        self._here: dict[Spot, str] = {}
        """The key of the value that lies at a spot."""
        self._before: dict[Value, str] = {}
        """The keys of the values that this item recalls."""
        self._known_needs: dict[tuple[Spot, ...], set[str]] = {}
        self._captured: list[tuple[Spot, Kept]] = []
        self._to_run: set[str] = set()
        self._ran: set[str] = set()

    def begin(self, *, same_item: bool) -> None:
        tasks = self._plan.tasks
        if not same_item:
            if self._has_item:  # until now it could be run again
                # A value left half done by a failed attempt equals no other.
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
        self, part: Part, given: Mapping[str, Any], outputs: Mapping[str, Value], repeats: int
    ) -> tuple[Known, float]:
        if not part.stream and not part.sinks:
            return {}, 0.0  # it is made when an item needs it
        steps = [*self._once, *part.computing] if part.stream else part.computing
        names = {step.name for step in steps}
        targets = [put_out(self._plan, v) for v in outputs.values() if v.node in names]
        targets += [spot for step in part.sinks for spot in read_by(self._plan, step)]
        targets += self._recalled if part.stream else []
        needed = self._needed(tuple(targets))
        steps = [step for step in steps if step.name in needed]
        self._ran = set()
        start = time.perf_counter()
        try:
            self._make_all(steps, targets, given, repeats)
        finally:
            self._settle()
        total = 1e3 * (time.perf_counter() - start)
        self._tell_warnings()
        self.kept = frozenset(step.name for step in steps if step.name not in self._ran)
        known = self._nothing
        for step in steps:
            known = self._pass_over(step, known)
        return known, total

    def end(self) -> None:
        self._has_item = True

    def changed(self, node: str) -> None:
        # A node that looks outside counts as one that has not run.
        self._outside.pop(node, None)

    def forget(self) -> None:
        super().forget()
        self._keys, self._before, self._has_item = {}, {}, False

    def inspect(self, value: Value) -> Any:
        """A value of the last item, made again if it is not there any more."""
        plan = self._plan
        if value not in plan.inspected:
            plan.inspected.add(value)
            for side in self._runner.sides:
                side.want(value.node)
        on_host = Spot(value, "host")
        spot = on_host if on_host in self._maker else Spot(value, "device")
        with collect_warnings([]):
            steps = [*self._once, *part_of(plan, stream=True).computing]
            self._make_all(steps, [spot], {}, 1)
        # On the device it was released at once if nothing in the graph reads it.
        kept = Kept(self._keys[value.node], value.port, spot.side)
        content = self._cache.take(kept) if kept in self._cache else self._held(spot)
        if isinstance(content, DeviceArray) and self._runner.device is not None:
            content = self._runner.device.download(content)
        self._settle()
        return lent(in_fractions(plan.tasks[value.node], content))

    def _make_all(
        self, steps: Sequence[Step], targets: Iterable[Spot], given: Mapping[str, Any], repeats: int
    ) -> None:
        """Make the targets, and nothing that is not needed for them.

        Nodes that look outside run first, one after the other: keys follow from what they made.
        Steps that are passed over take the times of when they ran.
        """
        begin = 0
        for end, step in enumerate(steps, start=1):
            task = self._plan.tasks.get(step.name)
            if task is None or not task.looks_outside:
                continue
            self._derive_keys(steps[begin : end - 1])
            if step.name not in self._outside:
                self._make(steps[:end], step.name, read_by(self._plan, step), given, 1)
                made = [self._runner.host[value] for value in step.writes]
                self._outside[step.name] = content_key(*made)
            key = self._keys[step.name] = self._outside[step.name]
            self._here |= dict.fromkeys(written_by(step), key)
            begin = end
        self._derive_keys(steps[begin:])
        self._make(steps, "", targets, given, repeats)
        times = self._runner.times
        for step in steps:
            if step.name in self._ran:
                continue
            if step.name in self._runs:
                times[step.name] = self._runs[step.name].milliseconds
            elif step.is_transfer:
                times.pop(step.name, None)

    def _make(
        self,
        steps: Sequence[Step],
        outside: str,
        targets: Iterable[Spot],
        given: Mapping[str, Any],
        repeats: int,
    ) -> None:
        """Bring the targets about, and run the node `outside`, if any, behind them."""
        restored = self._settle_what_runs(steps, outside, targets, pin=repeats > 1)
        if not restored and not self._to_run:
            return
        times = self._runner.times
        runs: list[dict[str, float]] = []
        self._captured = []
        try:
            for _ in range(repeats):
                for spot, value in restored.items():
                    self._restore(spot, value)
                self._runner.walk(steps, self._nothing, partial(self._run, given=given))
                runs.append({name: times[name] for name in self._to_run if name in times})
        except BaseException:
            self._take_back()
            raise
        for name in self._to_run:
            if timed := [run[name] for run in runs[1:] or runs if name in run]:
                times[name] = median(timed)
            self._note(name)
        self._ran |= self._to_run
        self._to_run = set()

    def _note(self, name: str) -> None:
        """Let the cache know how long a node's run took."""
        if name in self._runs:
            took = self._runner.times.get(name, 0.0)
            run = self._runs[name] = replace(self._runs[name], milliseconds=took)
            if name in self._keys:
                self._cache.note(self._keys[name], run)

    def _run(self, step: Step, known: Known, *, given: Mapping[str, Any]) -> Known:
        """Run one step into the cache, or pass over it."""
        if step.name not in self._to_run:
            return self._pass_over(step, known)
        warnings: list[str] = []
        with collect_warnings(warnings, marked=True):
            known = self._runner.execute(step, known, given)
        self._capture(step, warnings)
        for value in step.release:
            self._here.pop(Spot(value, "device"), None)
        self._runner.release(step)
        return known

    def _pass_over(self, step: Step, known: Known) -> Known:
        shapes = self._runs[step.name].shapes if step.name in self._plan.tasks else {}
        return self._runner.pass_over(step, known, shapes)

    def _capture(self, step: Step, warnings: Sequence[str]) -> None:
        """Keep the outputs of a step that were requested of its node."""
        if not step.is_transfer:
            shapes = dict(self._runner.shapes_of(step))
            self._runs[step.name] = Run(shapes, 0.0, tuple(warnings))
        task = self._plan.tasks.get(step.name)
        asks = task is not None and task.node.wanted is not None
        for spot in written_by(step):
            key = self._keys.get(spot.value.node)
            unread = asks and spot.value.port not in self._plan.wanted(step.name)
            if key is not None and not unread:
                kept = Kept(key, spot.value.port, spot.side)
                self._here[spot] = key
                self._captured.append((spot, kept))
                self._cache.put(kept, self._held(spot))

    def _needed(self, targets: tuple[Spot, ...]) -> set[str]:
        """The steps that the targets come of, by name."""
        if targets in self._known_needs:
            return self._known_needs[targets]
        needed = self._known_needs[targets] = set[str]()
        waiting = list(targets)
        while waiting:
            step = self._maker[waiting.pop()]
            if step.name not in needed:
                needed.add(step.name)
                waiting.extend(read_by(self._plan, step))
        return needed

    def _settle(self) -> None:
        """Release the device's values of this item; kept values are in the cache."""
        device = self._runner.device
        stays = {spot for spot in self._recalled if spot.side == "device"}
        stays |= {Spot(value, "device") for value in self._plan.stays}
        for spot in [s for s in self._here if s.side == "device" and s not in stays]:
            if self._plan.tasks[spot.value.node].stream and device is not None:
                device.drop([spot.value])
                del self._here[spot]

    def _tell_warnings(self) -> None:
        """Repeat the warnings of all nodes, also of those whose results are kept."""
        self._runner.notes[:] = self._of_source
        for step in self._plan.steps:
            if step.name in self._keys and step.name in self._runs:
                with GraphNames(partial(feed_of, self._plan, self._plan.tasks[step.name])):
                    for warning in self._runs[step.name].warnings:
                        warn(warning)

    def _derive_keys(self, steps: Iterable[Step]) -> None:
        """Find the keys of nodes that compute, and the known runs with these keys."""
        for step in steps:
            task = self._plan.tasks.get(step.name)
            if task is None:
                continue
            key = self._keys[step.name] = self._key(task, step)
            run = self._cache.run(key)
            if run is None:
                self._runs.pop(step.name, None)
            else:
                self._runs[step.name] = run

    def _key(self, task: Task, step: Step) -> str:
        node, device = task.node, self._runner.device
        calls = self._plan.placements[task.id].calls
        # A size that no input has follows from the sources.
        is_free = task.filled or bool(node.free_symbols)
        sources = sorted((n, key) for n, key in self._outside.items() if n in self._keys)
        reads = {} if task.filled else task.reads
        return key_of(
            node.serial,
            device.serial if device is not None and (step.on_device or calls) else "",
            step.kind,
            sorted(task.settings.items()),
            [(name, self._keys[value.node], value.port) for name, value in reads.items()],
            [(self._keys[value.node], value.port) for value in task.conditions],
            self._keys[task.instead] if task.instead is not None else "",
            [(name, self._before.get(value)) for name, value in task.recalls.items()],
            sources if is_free else (),
        )

    def _settle_what_runs(
        self, steps: Sequence[Step], outside: str, targets: Iterable[Spot], *, pin: bool
    ) -> dict[Spot, Any]:
        """Find, from the targets backwards, the steps to run, and the kept values to restore.

        `pin` also restores what a walk may release and the next one reads again.
        """
        waiting = list(targets)
        self._to_run = {outside} if outside else set()

        def run(step: Step) -> None:
            if step.name not in self._to_run:
                self._to_run.add(step.name)
                waiting.extend(read_by(self._plan, step))

        for step in steps:
            if step.name in self._keys and step.name not in self._runs:
                run(step)
        restored: dict[Spot, Any] = {}
        seen: set[Spot] = set()
        while waiting:
            spot = waiting.pop()
            if spot in seen:
                continue
            seen.add(spot)
            key = self._keys.get(spot.value.node, "")
            kept = Kept(key, spot.value.port, spot.side)
            maker = self._maker[spot]
            if key and self._here.get(spot) == key:
                if pin and spot.side == "device":
                    restored[spot] = self._held(spot)
            elif maker.name in self._to_run:
                pass
            elif kept in self._cache:
                restored[spot] = self._cache.take(kept)
            else:
                run(maker)
        return restored

    def _take_back(self) -> None:
        """Forget the values of a walk that failed: they may be incomplete."""
        for spot, kept in self._captured:
            self._cache.drop(kept)
            self._here.pop(spot, None)
        for name in self._to_run:
            self._runs.pop(name, None)
        self._to_run = set()

    def _held(self, spot: Spot) -> Any:
        if spot.side == "host":
            return self._runner.host[spot.value]
        assert self._runner.device is not None
        return self._runner.device.get(spot.value)

    def _restore(self, spot: Spot, value: Any) -> None:
        self._here[spot] = self._keys[spot.value.node]
        if spot.side == "host":
            self._runner.host.put(spot.value, value)
        else:
            assert self._runner.device is not None
            self._runner.device.put(spot.value, value)
