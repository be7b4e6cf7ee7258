"""Run only what changed: the steps of a plan whose results are not kept.

A node's run has a key: the node, its back end and device, its settings and the keys of what it
reads.  Equal keys are computed once.  What looks outside (a source, or what keeps a session or
names a file) runs for every item; its key is what it made.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from statistics import median
from typing import Any, NamedTuple

from tactograph.graph.plan.draft import Task, Value
from tactograph.graph.plan.plan import Plan, Step
from tactograph.graph.plan.sizes import Shapes
from tactograph.graph.run.cache import Cache, Kept, Run, Side
from tactograph.graph.run.device_values import DeviceValues
from tactograph.graph.run.host_values import HostValues
from tactograph.graph.run.keys import content_key, key_of
from tactograph.graph.run.looks_outside import looks_outside

Walk = Callable[[Sequence[Step]], None]
"""Goes through steps, runs those of `Incremental.to_run` and passes over the others."""


class Spot(NamedTuple):
    """A value, and where it lies."""

    value: Value
    side: Side


class Incremental:
    """What a plan need not run again.

    Attributes
    ----------
    to_run
        The steps of the present walk that are not passed over, by name.
    ran
        The steps that were run for this item.
    """

    def __init__(
        self, plan: Plan, cache: Cache, host: HostValues, device: DeviceValues | None
    ) -> None:
        self._plan, self._cache = plan, cache
        self._host, self._device = host, device
        self._maker = {spot: step for step in plan.steps for spot in _written(step)}
        self._keys: dict[str, str] = {}
        self._outside: dict[str, str] = {}
        self._runs: dict[str, Run] = {}
        self._here: dict[Spot, str] = {}
        self._before: dict[Value, str] = {}
        self._captured: list[tuple[Spot, Kept]] = []
        self.to_run: set[str] = set()
        self.ran: set[str] = set()

    def begin(self, *, again: bool) -> None:
        """Begin an item, or, `again`, the last one with its sources as they are."""
        tasks = self._plan.tasks
        if not again:
            self._outside = {n: key for n, key in self._outside.items() if not tasks[n].stream}
            recalled = {v for task in tasks.values() for v in task.recalls.values()}
            self._before = {v: self._keys[v.node] for v in recalled if v.node in self._keys}
        self._here = {
            spot: key
            for spot, key in self._here.items()
            if not tasks[spot.value.node].stream or spot.value.node in self._outside
        }
        self._keys, self.ran = {}, set()

    def forget(self) -> None:
        """Let the next item be a first one."""
        self._keys, self._before = {}, {}

    def changed(self, node: str) -> None:
        """Take a node that looks outside for one that has not run: its settings changed."""
        self._outside.pop(node, None)

    def compute(
        self,
        steps: Sequence[Step],
        targets: Iterable[Spot],
        walk: Walk,
        times: dict[str, float],
        repeats: int = 1,
    ) -> None:
        """Make the targets, and nothing that is not needed for them.

        `times` takes the milliseconds of every step, those of what is passed over from when
        it was made.
        """
        done = 0
        for end, step in enumerate(steps, start=1):
            if not self._looks_outside(step):
                continue
            self._derive(steps[done : end - 1])
            if step.name not in self._outside:
                self._make(steps[:end], step.name, read_by(self._plan, step), walk, times, 1)
                made = [self._host[value] for value in step.writes]
                self._outside[step.name] = content_key(*made)
            key = self._keys[step.name] = self._outside[step.name]
            self._here |= dict.fromkeys(_written(step), key)
            done = end
        self._derive(steps[done:])
        self._make(steps, "", targets, walk, times, repeats)
        for step in steps:
            if step.name in self.ran:
                continue
            if step.name in self._runs:
                times[step.name] = self._runs[step.name].milliseconds
            elif step.is_transfer:
                times.pop(step.name, None)

    def needed(self, targets: Iterable[Spot]) -> set[str]:
        """The steps that the targets come of, by name."""
        found: set[str] = set()
        waiting = list(targets)
        while waiting:
            step = self._maker[waiting.pop()]
            if step.name not in found:
                found.add(step.name)
                waiting.extend(read_by(self._plan, step))
        return found

    def reach(self, value: Value, walk: Walk) -> Any:
        """A value of the last item, made again if it is not there any more."""
        on_host = Spot(value, "host")
        spot = on_host if on_host in self._maker else Spot(value, "device")
        steps = [step for step in self._plan.steps if not self._is_sink(step)]
        self.compute(steps, [spot], walk, {})
        # On the device it was released at once if nothing in the graph reads it.
        kept = Kept(self._keys[value.node], value.port, spot.side)
        return self._cache.take(kept) if kept in self._cache else self._held(spot)

    def settle(self) -> None:
        """Give back what lies on the device for this item alone: the cache has what is kept."""
        recalled = {spot for spot in recalled_by(self._plan) if spot.side == "device"}
        for spot in [s for s in self._here if s.side == "device" and s not in recalled]:
            if self._plan.tasks[spot.value.node].stream and self._device is not None:
                self._device.drop([spot.value])
                del self._here[spot]

    def shapes_of(self, step: Step) -> Shapes:
        """The shapes of what a node made that is passed over."""
        return self._runs[step.name].shapes

    def capture(self, step: Step, shapes: Shapes, warnings: Sequence[str]) -> None:
        """Keep what a step of this walk made."""
        if step.kind in ("run", "fill"):
            self._runs[step.name] = Run(dict(shapes), 0.0, tuple(warnings))
        unread = self._unread(step)
        for spot in _written(step):
            key = self._keys.get(spot.value.node)
            if key is not None and spot.value.port not in unread:
                kept = Kept(key, spot.value.port, spot.side)
                self._here[spot] = key
                self._captured.append((spot, kept))
                self._cache.put(kept, self._held(spot))

    def released(self, step: Step) -> None:
        """What a step released is not on the device any more."""
        for value in step.release:
            self._here.pop(Spot(value, "device"), None)

    def warnings(self) -> Iterator[str]:
        """What the nodes had to say, now or when they made what is kept."""
        for step in self._plan.steps:
            if step.name in self._keys and step.name in self._runs:
                yield from self._runs[step.name].warnings

    def _unread(self, step: Step) -> set[str]:
        """The outputs that a node was not asked for."""
        task = self._plan.tasks.get(step.name)
        if task is None or task.node.wanted is None:
            return set()
        wanted = self._plan.wanted(task.id)
        return {port for port in task.node.outputs if port not in wanted}

    def _looks_outside(self, step: Step) -> bool:
        task = self._plan.tasks.get(step.name)
        return task is not None and looks_outside(task)

    def _is_sink(self, step: Step) -> bool:
        task = self._plan.tasks.get(step.name)
        return task is not None and task.node.sink

    def _derive(self, steps: Iterable[Step]) -> None:
        """Find the keys of nodes that compute, and what is known of runs with these keys."""
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
        node = task.node
        # A size that no input tells follows from what the sources gave.
        is_free = task.filled or bool(node.free_symbols)
        sources = sorted((n, key) for n, key in self._outside.items() if n in self._keys)
        reads = {} if task.filled else task.reads
        return key_of(
            node.serial,
            self._device.serial if self._device is not None and step.on_device else "",
            step.kind,
            sorted(task.settings.items()),
            [(name, self._keys[value.node], value.port) for name, value in reads.items()],
            [(name, self._before.get(value)) for name, value in task.recalls.items()],
            sources if is_free else (),
        )

    def _make(
        self,
        steps: Sequence[Step],
        outside: str,
        targets: Iterable[Spot],
        walk: Walk,
        times: dict[str, float],
        repeats: int,
    ) -> None:
        """Bring the targets about, and run the node `outside`, if any, behind them."""
        enter = self._missing(steps, outside, targets, pin=repeats > 1)
        if not enter and not self.to_run:
            return
        self._captured = []
        runs: list[dict[str, float]] = []
        try:
            for _ in range(repeats):
                for spot, value in enter.items():
                    self._restore(spot, value)
                walk(steps)
                runs.append({name: times[name] for name in self.to_run if name in times})
        except BaseException:
            self._take_back()
            raise
        for name in self.to_run:
            timed = [run[name] for run in runs[1:] or runs if name in run]
            if timed:
                times[name] = median(timed)
            if name in self._runs:
                run = self._runs[name] = replace(
                    self._runs[name], milliseconds=times.get(name, 0.0)
                )
                if name in self._keys:
                    self._cache.note(self._keys[name], run)
        self.ran |= self.to_run
        self.to_run = set()

    def _missing(
        self, steps: Sequence[Step], outside: str, targets: Iterable[Spot], *, pin: bool
    ) -> dict[Spot, Any]:
        """Settle what is to be run; return what is kept and is to be put in its place.

        With `pin` also what a walk may release and the next one reads again.
        """
        waiting = list(targets)
        self.to_run = {outside} if outside else set()

        def run(step: Step) -> None:
            if step.name not in self.to_run:
                self.to_run.add(step.name)
                waiting.extend(read_by(self._plan, step))

        for step in steps:
            if step.name in self._keys and step.name not in self._runs:
                run(step)
        enter: dict[Spot, Any] = {}
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
                    enter[spot] = self._held(spot)
            elif maker.name in self.to_run:
                pass
            elif kept in self._cache:
                enter[spot] = self._cache.take(kept)
            else:
                run(maker)
        return enter

    def _take_back(self) -> None:
        """Forget what was begun: it may never have been completed."""
        for spot, kept in self._captured:
            self._cache.drop(kept)
            self._here.pop(spot, None)
        for name in self.to_run:
            self._runs.pop(name, None)
        self.to_run = set()

    def _held(self, spot: Spot) -> Any:
        if spot.side == "host":
            return self._host[spot.value]
        assert self._device is not None
        return self._device.get(spot.value)

    def _restore(self, spot: Spot, value: Any) -> None:
        self._here[spot] = self._keys[spot.value.node]
        if spot.side == "host":
            self._host.put(spot.value, value)
        else:
            assert self._device is not None
            self._device.put(spot.value, value)


def read_by(plan: Plan, step: Step) -> list[Spot]:
    """What a step reads of this item, and where."""
    if step.is_transfer:
        return [Spot(step.reads[0], "host" if step.kind == "upload" else "device")]
    if step.kind == "fill":
        return []
    ports = plan.tasks[step.name].node.inputs
    return [
        Spot(value, _side(ports[name].kind, step.on_device))
        for name, value in plan.tasks[step.name].reads.items()
        if not (step.on_device and ports[name].kind == "object")
    ]


def recalled_by(plan: Plan) -> list[Spot]:
    """What the next item reads of this one, and where."""
    return [
        Spot(value, _side(task.node.inputs[name].kind, plan.placements[task.id].on_device))
        for task in plan.tasks.values()
        for name, value in task.recalls.items()
        if not task.filled
    ]


def _side(kind: str, on_device: bool) -> Side:
    return "device" if on_device and kind == "array" else "host"


def _written(step: Step) -> list[Spot]:
    on_device = step.kind == "upload" or (step.on_device and step.kind != "download")
    return [Spot(value, "device" if on_device else "host") for value in step.writes]
