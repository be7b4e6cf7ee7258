"""Run the steps of a plan: what depends on no stream once, the rest item by item."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from statistics import median
from typing import Any

from threadpoolctl import ThreadpoolController

from tactograph.graph.backends.device_backend import DeviceBackend
from tactograph.graph.errors import DeviceError, EndOfStream, collect_warnings
from tactograph.graph.plan.draft import Value
from tactograph.graph.plan.plan import Plan, Step
from tactograph.graph.plan.sizes import Known, Shapes, Sized
from tactograph.graph.run.device_values import DeviceValues
from tactograph.graph.run.host_values import HostValues
from tactograph.graph.run.make_provenance import make_provenance
from tactograph.graph.run.result import Result


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

    def prepare(self) -> None:
        """Run, once, what does not depend on the stream."""
        if self._known is None:
            self.begin()
            self._known, _ = self._run(self._once, {}, {})
            self._lasting = len(self.notes)

    def begin(self) -> None:
        """Forget the warnings of the item before, but not those of what ran once."""
        del self.notes[self._lasting :]

    def item(self, given: Mapping[str, Any], repeats: int = 1) -> Result:
        """Run one item of the stream, `given` what its source yielded; see `Pipeline.items`."""
        assert self._known is not None
        _, total = self._run(self._stream, self._known, given, repeats)
        host, tasks = self.host, self._plan.tasks
        outputs = {name: host.lent(value) for name, value in self._plan.outputs.items()}
        yielded = [Value(name, port) for name in given for port in tasks[name].node.outputs]
        item = {value: host[value] for value in yielded}
        host.remember()
        if self._device is not None:
            self._device.remember()
        return Result(outputs, dict(self.times), self._plan, list(self.notes), item, total)

    def rehearse(self, given: Mapping[str, Any]) -> None:
        """Compute an item that nobody sees: kernels are compiled, and caches filled."""
        assert self._known is not None
        self.begin()
        with collect_warnings([]):
            self._compute(self._stream[0], self._known, given)
        self.forget()

    def forget(self) -> None:
        """Let the next item be a first one: nothing came before it."""
        self.host.forget()
        if self._device is not None:
            self._device.forget()

    def settings_changed(self, tasks: Iterable[str]) -> None:
        """Work out anew what follows from settings of nodes: sizes and launches.

        Behind them sizes are worked out anew, too; launches only where sizes are others.
        """
        for name in tasks:
            self._sized.pop(name, None)
            if self._device is not None:
                self._device.drop_launch(name)

    def end(self) -> None:
        """Close what the nodes keep; a node outside the stream that kept something runs again."""
        self.forget()
        if any(not self._plan.tasks[name].stream for name in self.host.sessions):
            self._known = None
        self.host.close()

    def _run(
        self,
        steps: tuple[list[Step], list[Step]],
        before: Known,
        given: Mapping[str, Any],
        repeats: int = 1,
    ) -> tuple[Known, float]:
        """Run steps in order, sinks last, when every time is known; return the total time."""
        computing, sinks = steps
        known = before
        runs: list[dict[str, float]] = []
        totals: list[float] = []
        # Nodes multiply small matrices, which OpenBLAS makes up to 50 times slower by sharing
        # them among threads that wait for one another.
        one_thread = self._libraries.limit(limits=1, user_api="blas")
        with collect_warnings(self.notes), one_thread:
            for _ in range(repeats):
                start = time.perf_counter()
                known = self._compute(computing, before, given)
                totals.append(1e3 * (time.perf_counter() - start))
                if repeats > 1:
                    runs.append(dict(self.times))
            for name in self.times if runs else ():
                self.times[name] = median(run[name] for run in runs[1:])
            for step in sinks:
                try:
                    known = self._execute(step, known, given)
                except EndOfStream:
                    # The other sinks take this item, too.
                    self.ended = True
        return known, median(totals[1:] or totals)

    def _compute(self, steps: list[Step], known: Known, given: Mapping[str, Any]) -> Known:
        device, doing = self._device, ""
        if device is not None:
            device.begin()
        try:
            for step in steps:
                doing = step.name
                known = self._execute(step, known, given)
            if device is not None:
                doing = ""
                self.times.update(device.finish())
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
        if step.kind in ("upload", "download"):
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
            else:
                keywords = {}
                if task.node.provenance is not None:
                    provenance = make_provenance(self._plan, self.times, sized.derived, self.notes)
                    keywords[task.node.provenance] = provenance
                made, self.times[task.id] = self.host.run(task, step, sized.sizes, keywords)
                shapes = self.host.enter(task, step, made)
            known = self._plan.sizes.behind(task, sized, shapes)
        if step.release and device is not None:
            device.release(step)
        return known


def _split(plan: Plan, *, stream: bool) -> tuple[list[Step], list[Step]]:
    """The steps that compute and the sinks, of the stream or outside it."""
    steps = [step for step in plan.steps if step.stream == stream]
    sinks = [s for s in steps if s.kind == "run" and plan.tasks[s.name].node.sink]
    return [step for step in steps if step not in sinks], sinks
