"""Run the steps of a plan: what depends on no stream once, the rest item by item.

Long because an item may be run afresh, in part, or once more, over the same values.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from statistics import median
from typing import Any

from threadpoolctl import ThreadpoolController

from tactograph.graph.backends.arrays import DeviceArray
from tactograph.graph.backends.device_backend import DeviceBackend
from tactograph.graph.errors import DeviceError, EndOfStream, InputError, collect_warnings, warn
from tactograph.graph.plan.draft import Value
from tactograph.graph.plan.plan import Plan, Step
from tactograph.graph.plan.sizes import Known, Shapes, Sized
from tactograph.graph.run.cache import Cache
from tactograph.graph.run.device_values import DeviceValues
from tactograph.graph.run.host_values import HostValues
from tactograph.graph.run.incremental import Incremental, Spot, Walk, read_by, recalled_by
from tactograph.graph.run.make_provenance import make_provenance
from tactograph.graph.run.ownership import lent
from tactograph.graph.run.result import Result
from tactograph.graph.run.trace import Trace
from tactograph.graph.run.whole_images import in_fractions


class Items:
    """The steps in order, on host and device, with their sizes, times and warnings.

    Attributes
    ----------
    host
        The values there, and what its nodes keep.
    times
        Milliseconds by step, of the last item and of what ran once.
    notes
        Warnings, those of what ran once first.
    ended
        Whether a sink wanted no further item.
    trace
        Takes down what runs when, if it is there.
    """

    def __init__(self, plan: Plan, device: DeviceBackend | None) -> None:
        self._plan = plan
        self.host = HostValues(plan)
        self._device = None if device is None else DeviceValues(plan, device, self.host)
        library = () if device is None else (device.error,)
        self._device_errors: tuple[type[Exception], ...] = (DeviceError, *library)
        self.times: dict[str, float] = {}
        self.notes: list[str] = []
        self.ended = False
        self._lasting = 0
        self._known: Known | None = None
        self._sized: dict[str, Sized] = {}
        self._libraries = ThreadpoolController()
        self._once = _split(plan, stream=False)
        self._stream = _split(plan, stream=True)
        self._incremental: Incremental | None = None
        self._of_source: list[str] = []
        self._nothing: Known = {}
        self._only: Collection[str] | None = None
        self._is_first = True
        self.stage = ""
        self.trace: Trace | None = None

    def keep(self, cache: Cache) -> None:
        """Run, from now on, only what is not in the cache."""
        self._incremental = Incremental(self._plan, cache, self.host, self._device)
        self._known = None
        self._lasting = 0

    @property
    def keeps(self) -> bool:
        return self._incremental is not None

    def prepare(self) -> None:
        """Run, once, what does not depend on the stream."""
        if self._known is not None:
            return
        self.begin()
        if self._incremental is None:
            self._known, _ = self._run(self._once, {}, {})
            self._lasting = len(self.notes)
            return
        # What else an item needs of it is settled with the item.
        self._known = {}
        if self._once[1]:
            self._incremental.begin(again=True)
            self._run(self._once, {}, {})

    def begin(self) -> None:
        """Forget the warnings of the item before, but not those of what ran once."""
        del self.notes[self._lasting :]

    @property
    def news(self) -> list[str]:
        """The warnings since `begin`."""
        return self.notes[self._lasting :]

    def item(self, given: Mapping[str, Any], repeats: int = 1) -> Result:
        """Run one item of the stream, `given` what its source yielded; see `Pipeline.items`."""
        assert self._known is not None
        if self._incremental is not None:
            # Not before: until then the last item can be run again.
            if not self._is_first:
                self._remember()
            self._is_first = False
            self._incremental.begin(again=False)
            self._of_source = list(self.notes)
            return self._incremental_item(self._incremental, given, repeats)
        _, total = self._run(self._stream, self._known, given, repeats)
        result = self._result(given, total)
        self._remember()
        return result

    def again(self, outputs: Collection[str] | None = None) -> Result:
        """Run the last item once more: settings as they are now, its sources as they were.

        Of the outputs only those that are named are made; sinks are then left out.
        """
        assert self._incremental is not None
        self._incremental.begin(again=True)
        self._only = outputs
        try:
            return self._incremental_item(self._incremental, {}, 1)
        finally:
            self._only = None

    def inspect(self, value: Value) -> Any:
        """A value of the last item, made again if it is not there any more."""
        incremental, device = self._incremental, self._device
        assert incremental is not None
        if value not in self._plan.inspected:
            self._plan.inspected.add(value)
            self.host.want(value.node)
            if device is not None:
                device.want(value.node)
        with collect_warnings([]):
            found = incremental.reach(value, self._walk({}))
        if isinstance(found, DeviceArray) and device is not None:
            found = device.download(found)
        incremental.settle()
        return lent(in_fractions(self._plan.tasks[value.node], found))

    def rehearse(self, given: Mapping[str, Any]) -> None:
        """Compute an item that nobody sees: kernels are compiled, and caches filled."""
        if self._incremental is not None:
            return  # what would be computed is kept
        assert self._known is not None
        self.begin()
        with collect_warnings([]):
            self._compute(self._stream[0], self._known, given)
        self.stage = ""
        self.forget()

    def forget(self) -> None:
        """Let the next item be a first one: nothing came before it."""
        self.host.forget()
        if self._device is not None:
            self._device.forget()
        if self._incremental is not None:
            self._incremental.forget()
        self._is_first = True

    def settings_changed(self, nodes: Iterable[str]) -> None:
        """Work out sizes and launches of nodes anew: they may follow from settings."""
        for name in nodes:
            if name in self._sized:
                self._sized[name].doubtful = True
            if self._device is not None:
                self._device.drop_launch(name)
            if self._incremental is not None:
                self._incremental.changed(name)
            if not self._plan.tasks[name].stream:
                self._known = None

    def end(self) -> None:
        """Close what the nodes keep; a node outside the stream that kept something runs again."""
        if any(not self._plan.tasks[name].stream for name in self.host.sessions):
            self._known = None
        self.host.close()

    def _incremental_item(
        self, incremental: Incremental, given: Mapping[str, Any], repeats: int
    ) -> Result:
        computing = [*self._once[0], *self._stream[0]]
        sinks = self._stream[1] if self._only is None else []
        if self._only is not None:
            asked = [Spot(value, "host") for value in self._outputs().values()]
            needed = incremental.needed([*asked, *recalled_by(self._plan)])
            computing = [step for step in computing if step.name in needed]
        try:
            _, total = self._run((computing, sinks), {}, given, repeats)
        finally:
            incremental.settle()
        result = self._result(given, total)
        result.kept = frozenset(s.name for s in computing if s.name not in incremental.ran)
        return result

    def _result(self, given: Mapping[str, Any], total: float) -> Result:
        host, tasks = self.host, self._plan.tasks
        outputs = {name: host.lent(value) for name, value in self._outputs().items()}
        yielded = [Value(name, port) for name in given for port in tasks[name].node.outputs]
        item = {value: host[value] for value in yielded}
        return Result(outputs, dict(self.times), self._plan, list(self.notes), item, total)

    def _outputs(self) -> dict[str, Value]:
        """The graph's outputs, or those of them that are asked for now."""
        known, only = self._plan.outputs, self._only
        return {name: value for name, value in known.items() if only is None or name in only}

    def _remember(self) -> None:
        """Keep what the next item recalls."""
        self.host.remember()
        if self._device is not None:
            self._device.remember()

    def _run(
        self,
        steps: tuple[list[Step], list[Step]],
        before: Known,
        given: Mapping[str, Any],
        repeats: int = 1,
    ) -> tuple[Known, float]:
        """Run steps in order, sinks last, when every time is known; return the total time."""
        computing, sinks = steps
        # Nodes multiply small matrices, which OpenBLAS makes up to 50 times slower by sharing
        # them among threads that wait for one another.
        one_thread = self._libraries.limit(limits=1, user_api="blas")
        with collect_warnings(self.notes), one_thread:
            if self._incremental is None:
                known, total = self._repeated(computing, before, given, repeats)
            else:
                known, total = self._changed(self._incremental, computing, sinks, given, repeats)
            for step in sinks:
                try:
                    known = self._execute(step, known, given)
                except EndOfStream:
                    # The other sinks take this item, too.
                    self.ended = True
            self.stage = ""
        return known, total

    def _repeated(
        self, steps: Sequence[Step], before: Known, given: Mapping[str, Any], repeats: int
    ) -> tuple[Known, float]:
        """Run all steps so often; times are then medians of all but the first."""
        known = before
        runs: list[dict[str, float]] = []
        totals: list[float] = []
        for _ in range(repeats):
            start = time.perf_counter()
            known = self._compute(steps, before, given)
            totals.append(1e3 * (time.perf_counter() - start))
            if repeats > 1:
                runs.append(dict(self.times))
        for name in self.times if runs else ():
            self.times[name] = median(run[name] for run in runs[1:])
        return known, median(totals[1:] or totals)

    def _changed(
        self,
        incremental: Incremental,
        steps: Sequence[Step],
        sinks: Sequence[Step],
        given: Mapping[str, Any],
        repeats: int,
    ) -> tuple[Known, float]:
        """Run the steps that what is wanted needs, and whose results are not kept."""
        there = {step.name for step in steps}
        wanted = [Spot(value, "host") for value in self._outputs().values()]
        wanted += [spot for step in sinks for spot in read_by(self._plan, step)]
        wanted = [spot for spot in wanted if spot.value.node in there]
        is_part = self._only is not None
        if is_part or len(steps) > len(self._once[0]) or not self._once[1]:
            wanted += recalled_by(self._plan)
        start = time.perf_counter()
        incremental.compute(steps, wanted, self._walk(given), self.times, repeats)
        total = 1e3 * (time.perf_counter() - start)
        self.notes[:] = self._of_source
        for warning in incremental.warnings():
            warn(warning)
        return self._behind(steps), total

    def _walk(self, given: Mapping[str, Any]) -> Walk:
        def walk(steps: Sequence[Step]) -> None:
            self._compute(steps, self._nothing, given)

        return walk

    def _behind(self, steps: Iterable[Step]) -> Known:
        """The sizes that are known behind steps that have all been run, now or before."""
        known = self._nothing
        for step in steps:
            known = self._pass_over(step, known)
        return known

    def _compute(self, steps: Sequence[Step], known: Known, given: Mapping[str, Any]) -> Known:
        device, incremental, doing = self._device, self._incremental, ""
        if device is not None:
            device.begin()
        try:
            for step in steps:
                doing = step.name
                if incremental is None:
                    known = self._execute(step, known, given)
                elif step.name in incremental.to_run:
                    known = self._execute_and_keep(incremental, step, known, given)
                else:
                    known = self._pass_over(step, known)
                    continue
                if step.release and device is not None:
                    device.drop(step.release)
            if device is not None:
                doing = ""
                self.stage = "waiting for the device"
                self.times.update(device.finish())
                if self.trace is not None:
                    for name, start, end in device.spans():
                        self.trace.on_device(name, start, end)
        except self._device_errors as error:
            raise self._device_error(error, doing) from error
        finally:
            self.host.all_arrived()
        return known

    def _device_error(self, error: Exception, doing: str) -> DeviceError:
        """Name the steps that failed: a device tells of them long after they began."""
        device = self._device
        failed = device.failed() if device is not None else []
        if isinstance(error, DeviceError) and not failed:
            return error
        begun = device.begun if device is not None else []
        named = ", ".join(map(self._in_words, failed or ([doing] if doing else begun)))
        return DeviceError(f"{self._plan.device} failed at {named}: {error}")

    def _in_words(self, step: str) -> str:
        task = self._plan.tasks.get(step)
        return f"'{step}'" if task is None else f"'{step}' ({task.node.name})"

    def _execute(self, step: Step, known: Known, given: Mapping[str, Any]) -> Known:
        """Run one step; return the sizes that are known behind it."""
        device = self._device
        self.stage = step.name
        if step.is_transfer:
            assert device is not None
            device.transfer(step)
        else:
            task = self._plan.tasks[step.name]
            sized = self._plan.sizes.around(task, known, self._sized.get(task.id))
            self._sized[task.id] = sized
            shapes: Shapes = {}
            if step.kind == "fill":
                (device if device is not None and step.on_device else self.host).fill(
                    task, sized.sizes
                )
                self.times[task.id] = 0.0
            elif step.on_device:
                assert device is not None
                shapes = device.launch(task, step, sized.sizes)
            elif task.id in given:
                shapes = self.host.enter(task, step, given[task.id])
            elif task.node.stream:
                raise InputError(
                    f"{self._plan.graph.name}: '{task.id}' has other settings than when its last "
                    "item came; go through items() for a new one"
                )
            else:
                keywords = {}
                if task.node.provenance is not None:
                    provenance = make_provenance(self._plan, self.times, sized.derived, self.notes)
                    keywords[task.node.provenance] = provenance
                made, self.times[task.id] = self.host.run(task, step, sized.sizes, keywords)
                if self.trace is not None:
                    self.trace.on_host(task.id, time.perf_counter(), self.times[task.id])
                shapes = self.host.enter(task, step, made)
            known = self._plan.sizes.behind(task, sized, shapes)
        return known

    def _execute_and_keep(
        self, incremental: Incremental, step: Step, known: Known, given: Mapping[str, Any]
    ) -> Known:
        """Run one step into the cache."""
        warnings: list[str] = []
        with collect_warnings(warnings):
            known = self._execute(step, known, given)
        sized = self._sized.get(step.name)
        shapes = sized.shapes if sized is not None else None
        incremental.capture(step, shapes or {}, warnings)
        incremental.released(step)
        return known

    def _pass_over(self, step: Step, known: Known) -> Known:
        """What is known behind a step whose results are kept."""
        assert self._incremental is not None
        task = self._plan.tasks.get(step.name)
        if task is None:
            return known
        sized = self._plan.sizes.around(task, known, self._sized.get(task.id))
        self._sized[task.id] = sized
        return self._plan.sizes.behind(task, sized, self._incremental.shapes_of(step))


def _split(plan: Plan, *, stream: bool) -> tuple[list[Step], list[Step]]:
    """The steps that compute and the sinks, of the stream or outside it."""
    steps = [step for step in plan.steps if step.stream == stream]
    sinks = [s for s in steps if s.kind == "run" and plan.tasks[s.name].node.sink]
    return [step for step in steps if step not in sinks], sinks
