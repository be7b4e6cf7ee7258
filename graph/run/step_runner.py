"""Run the steps of a plan one by one, on host and device, with their sizes and times."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from tactograph.graph.backends.device_backend import DeviceBackend
from tactograph.graph.backends.device_call import DeviceCall
from tactograph.graph.errors import DeviceError, InputError
from tactograph.graph.plan.draft import Task, Value
from tactograph.graph.plan.plan import Plan, Step
from tactograph.graph.plan.sizes import Bounds, Shapes, Sized
from tactograph.graph.plan.spots import Side, written_by
from tactograph.graph.run.device_values import DeviceValues
from tactograph.graph.run.host_values import HostValues
from tactograph.graph.run.make_provenance import make_provenance
from tactograph.graph.run.progress import progress_text, tell_progress


class StepRunner:
    """Runs steps on the present item's values, on the `host` and on the `device`, if there is one.

    `times` has milliseconds by step, including steps that ran once.  `notes` are the warnings;
    those of steps that ran once come first.  `stage` is the step that runs now, for another thread
    to show; "" between items.
    """

    def __init__(self, plan: Plan, device: DeviceBackend | None) -> None:
        self.plan = plan
        self.host = HostValues(plan)
        self.device = None if device is None else DeviceValues(plan, device, self.host)
        self._calls = {} if device is None else _calls(plan, device)
        self.sides: list[HostValues | DeviceValues] = [self.host, *filter(None, [self.device])]
        library = () if device is None else (device.error,)
        self._device_errors: tuple[type[Exception], ...] = (DeviceError, *library)
        self.times: dict[str, float] = {}
        self.notes: list[str] = []
        self.stage = ""
        self._sized: dict[str, Sized] = {}

    @property
    def stage_in_words(self) -> str:
        """The step that runs now, with its number if it is outside the stream."""
        name, plan = self.stage, self.plan
        if name not in plan.tasks:
            return name
        once = [step.name for step in plan.steps if step.kind == "run" and not step.stream]
        place = f", {once.index(name) + 1} of {len(once)}" if name in once else ""
        progress = f", {text}" if (text := progress_text()) else ""
        return f"{name} ({plan.tasks[name].node.name}){place}{progress}"

    def side(self, name: Side) -> HostValues | DeviceValues:
        """The values on the host, or those on the device."""
        return self.device if name == "device" and self.device is not None else self.host

    def walk(
        self, steps: Sequence[Step], bounds: Bounds, run: Callable[[Step, Bounds], Bounds]
    ) -> Bounds:
        """Call `run` for each step, then wait for the device; return the sizes behind the last.

        `bounds` are the sizes before the first step.  `run` runs a step, or passes over it, and
        returns the sizes that are known behind it.
        """
        doing = ""
        if self.device is not None:
            self.device.begin()
        try:
            for step in steps:
                doing = step.name
                bounds = run(step, bounds)
            doing = ""
            if self.device is not None:
                self.stage = "waiting for the device"
                self.times.update(self.device.finish())
        except self._device_errors as error:
            raise self._device_error(error, doing) from error
        finally:
            self.host.all_arrived()
        return bounds

    def execute(self, step: Step, bounds: Bounds, yields: Mapping[str, Any]) -> Bounds:
        """Run one step; return the sizes that are known behind it.

        `yields` holds the values of the stream's source, by node.
        """
        self.stage = step.name
        tell_progress("")
        if not all(map(self.host.holds, step.conditions)):
            return self._leave_out(step, bounds)
        if step.is_transfer:
            assert self.device is not None
            self.times[step.name] = 0.0  # what is absent is not moved
            self.device.transfer(step)
            return bounds
        task = self.plan.tasks[step.name]
        sized = self._around(task, bounds)
        if step.kind == "fill":
            self.side("device" if step.on_device else "host").fill(task, sized.sizes)
            self.times[task.id], shapes = 0.0, {}
        elif step.on_device:
            assert self.device is not None
            shapes = self.device.launch(task, step, sized.sizes)
        elif task.id in yields:
            shapes = self.host.enter(task, step, yields[task.id])
        else:
            shapes = self._call(task, step, sized)
        return self.plan.sizes.behind(task, sized, shapes)

    def _leave_out(self, step: Step, bounds: Bounds) -> Bounds:
        """Skip a step: its outputs are those of its `else` node, or absent from this item."""
        self._sized.pop(step.name, None)
        self.times[step.name] = 0.0
        task = self.plan.tasks.get(step.name)
        inherited = {} if task is None else task.inherited
        for value, side in written_by(step):
            values, other = self.side(side), inherited.get(value)
            values.put(value, None if other is None else values.get(other))
        other_sized = None if task is None else self._sized.get(task.instead or "")
        if other_sized is None:
            return bounds
        return self.pass_over(step, bounds, other_sized.shapes or {})

    def release(self, step: Step) -> None:
        """Release the buffers that this step was the last to read."""
        if step.release and self.device is not None:
            self.device.drop(step.release)

    def pass_over(self, step: Step, bounds: Bounds, shapes: Shapes) -> Bounds:
        """The sizes that are known behind a step that does not run; its outputs have `shapes`."""
        task = self.plan.tasks.get(step.name)
        if task is None:
            return bounds
        return self.plan.sizes.behind(task, self._around(task, bounds), shapes)

    def shapes_of(self, step: Step) -> Shapes:
        """The shapes of a step's last outputs."""
        sized = self._sized.get(step.name)
        return {} if sized is None else sized.shapes or {}

    def lent(self, values: Iterable[Value], *, cached: bool) -> dict[Value, Any]:
        """Outputs for the caller; `cached` means that a cache holds them, too."""
        stays = {value for value in values if value in self.plan.stays}
        on_device = {} if self.device is None else self.device.lent(stays, cached=cached)
        return {**{v: self.host.lent(v) for v in values if v not in stays}, **on_device}

    def settings_changed(self, node: str) -> None:
        """Recompute a node's sizes and launch, since they may depend on its settings."""
        if node in self._sized:
            self._sized[node].doubtful = True
        if self.device is not None:
            self.device.drop_launch(node)

    def _around(self, task: Task, bounds: Bounds) -> Sized:
        sized = self.plan.sizes.around(task, bounds, self._sized.get(task.id))
        self._sized[task.id] = sized
        return sized

    def _call(self, task: Task, step: Step, sized: Sized) -> Shapes:
        """Call a node's function."""
        if task.node.stream or task.stand_in:
            raise InputError(
                f"{self.plan.graph.name}: the settings of '{task.id}' changed after its last "
                "item; get a new item from items()"
            )
        keywords: dict[str, Any] = dict(self._calls.get(task.id, {}))
        if task.node.provenance is not None:
            provenance = make_provenance(self.plan, self.times, sized.derived, self.notes)
            keywords[task.node.provenance] = provenance
        result, self.times[task.id] = self.host.run(task, step, sized.sizes, keywords)
        return self.host.enter(task, step, result)

    def _device_error(self, error: Exception, doing: str) -> DeviceError:
        """Name the steps that failed: a device reports a failure long after the step began."""
        failed = self.device.failed() if self.device is not None else []
        if isinstance(error, DeviceError) and not failed:
            return error
        timed = self.device.timed_steps if self.device is not None else []
        tasks, steps = self.plan.tasks, failed or ([doing] if doing else timed)
        ops = {name: f" ({tasks[name].node.name})" for name in steps if name in tasks}
        named = ", ".join(f"'{name}'{ops.get(name, '')}" for name in steps)
        return DeviceError(f"{self.plan.device} failed at {named}: {error}")


def _calls(plan: Plan, device: DeviceBackend) -> dict[str, dict[str, DeviceCall]]:
    """By node on the host, its arguments that call other nodes on the device."""
    return {
        task: {name: DeviceCall(plan.tasks[task].node.calls[name], device) for name in place.calls}
        for task, place in plan.placements.items()
    }
