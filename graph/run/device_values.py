"""Values on the device: transfers, launches and their times."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from numpy.typing import NDArray

from tactograph.graph.backends.arrays import DeviceArray
from tactograph.graph.backends.device_backend import DeviceBackend, PreparedNode, Timer
from tactograph.graph.plan.draft import Task, Value
from tactograph.graph.plan.plan import Plan, Step
from tactograph.graph.plan.sizes import Shapes
from tactograph.graph.run.host_values import HostValues, constant
from tactograph.graph.run.node_errors import Blaming
from tactograph.graph.run.previous_values import recall, recalled_values
from tactograph.graph.run.whole_images import read_whole


class DeviceValues:
    """Buffers on the device by value, those of the item before, and launches."""

    def __init__(self, plan: Plan, device: DeviceBackend, host: HostValues) -> None:
        self._plan, self._device, self._host = plan, device, host
        self._values: dict[Value, DeviceArray] = {}
        self._before: dict[Value, DeviceArray] = {}
        self._launches: dict[str, PreparedNode] = {}
        self._timers: dict[str, Timer] = {}
        self._idle: list[str] = []
        self._recalled = recalled_values(plan)
        self._read_whole = read_whole(plan)
        self._wanted = {name: plan.wanted(name) for name in plan.tasks}
        self._sent = {task.id: _sent(task) for task in plan.tasks.values()}
        self._asked = {task.id: _asked(task) for task in plan.tasks.values()}
        for task in plan.tasks.values():
            if plan.placements[task.id].on_device and not task.filled:
                device.compile(task.node)

    @property
    def serial(self) -> str:
        """Unique identifier of the device and its compiled kernels."""
        return self._device.serial

    def get(self, value: Value) -> DeviceArray | None:
        """A value on the device; None if it is absent from this item."""
        return self._values.get(value)

    def put(self, value: Value, array: DeviceArray | None) -> None:
        """Enter a value that was made before."""
        self._values.pop(value, None)
        if array is not None:
            self._values[value] = array

    def download(self, source: DeviceArray) -> NDArray[Any]:
        """A copy of an array on the host, read-only."""
        array = self._device.download(source)
        array.flags.writeable = False
        return array

    def drop(self, values: Iterable[Value]) -> None:
        """Give back the buffers of values that no later step reads."""
        for value in values:
            self._values.pop(value, None)

    def begin(self) -> None:
        """Start timing."""
        self._timers, self._idle = {}, []

    def transfer(self, step: Step) -> None:
        """Begin a transfer; readers on the host wait for it, the device keeps its own order."""
        (value,) = step.reads
        if step.kind == "download":
            if (source := self._values.get(value)) is None:
                self._host.put(value, None)
                return
            array, timer = self._device.start_download(source)
            self._host.receive(value, array, timer[1])
        elif (array := self._host[value]) is not None:
            port = self._plan.tasks[value.node].node.outputs[value.port]
            as_float = array.dtype != port.dtype and value not in self._read_whole
            device = self._device
            start = device.start_upload_of_fraction if as_float else device.start_upload
            self._values[value], timer = start(array)
        else:
            # An item that failed may have left one.
            self._values.pop(value, None)
            return
        self._timers[step.name] = timer

    def fill(self, task: Task, sizes: Mapping[str, int]) -> None:
        """Make the constant that stands in for a node."""
        port, shape, dtype, neutral = constant(task, sizes)
        self._values[Value(task.id, port)] = self._device.fill(shape, dtype, neutral)

    def _hand_on(self, task: Task) -> Shapes | None:
        """Hand on the input of an idle node, or nothing; return None if the node has to run."""
        node, neutral = task.node, task.node.neutral
        if node.is_idle is None or not self._is_idle(task, node.is_idle):
            return None
        ((name, port),) = node.outputs.items()
        made = Value(task.id, name)
        if port.optional:
            self._values.pop(made, None)
            self._idle.append(task.id)
            return {}
        if not isinstance(neutral, str) or neutral not in task.reads:
            return None
        handed_on = self._values.get(task.reads[neutral])
        as_float = made in self._plan.inspected or made not in self._read_whole
        if handed_on is None or (as_float and handed_on.dtype != port.dtype):
            return None
        self._values[made] = handed_on
        self._idle.append(task.id)
        return {name: handed_on.shape}

    def _is_idle(self, task: Task, is_idle: Callable[..., bool]) -> bool:
        """Ask a node whether it is idle, unless that would mean to wait."""
        values = self._asked[task.id].items()
        asked = {name: self._host.ready(value) for name, value in values}
        return all(value is not None for value in asked.values()) and is_idle(**asked)

    def launch(self, task: Task, step: Step, sizes: Mapping[str, int]) -> Shapes:
        """Enqueue a node; return the shapes of its outputs."""
        if (handed_on := self._hand_on(task)) is not None:
            return handed_on
        inputs = {
            name: self._values.get(value) if is_array else self._host[value]
            for name, value, is_array in self._sent[task.id]
        }
        for name in task.recalls:
            port = task.node.inputs[name]
            if port.kind == "array":
                recalled = inputs[name] = recall(task, name, self._before, sizes)
            else:
                recalled = inputs[name] = self._host.recall(task, name, sizes)
            if isinstance(recalled, DeviceArray):
                # A size that depends on the data is that of the item before.
                before = zip(port.dims, recalled.shape, strict=True)
                sizes = {**{d: n for d, n in before if isinstance(d, str)}, **sizes}
        launch = self._launches.get(task.id)
        with Blaming(task, self._device.error):
            if launch is None or launch.sizes != sizes:
                wanted = self._wanted[task.id]
                launch = self._device.prepare(task.node, task.settings, sizes, wanted)
                self._launches[task.id] = launch
            outputs, self._timers[task.id] = launch.launch(inputs)
        for value in step.writes:
            if value.port in outputs:
                self._values[value] = outputs[value.port]
        if launch.shapes is not None:
            return launch.shapes
        return {name: array.shape for name, array in outputs.items()}

    def finish(self) -> dict[str, float]:
        """Wait for the device; return milliseconds by step."""
        if self._timers:
            self._device.finish()
        times = {name: self._device.milliseconds(timer) for name, timer in self._timers.items()}
        return {**times, **dict.fromkeys(self._idle, 0.0)}

    def spans(self) -> list[tuple[str, float, float]]:
        """Step, start and end of all timed steps, as times of `time.perf_counter`."""
        ahead = self._device.clock_ahead
        spans = ((name, *self._device.span(timer)) for name, timer in self._timers.items())
        return [(name, start - ahead, end - ahead) for name, start, end in spans]

    def failed(self) -> list[str]:
        """The steps that failed, which a device reports long after they began."""
        return [name for name, timer in self._timers.items() if self._device.has_failed(timer)]

    @property
    def begun(self) -> list[str]:
        """The steps that are timed."""
        return list(self._timers)

    def want(self, node: str) -> None:
        """Ask a node for the outputs that the plan reads of it now."""
        self._wanted[node] = self._plan.wanted(node)
        self.drop_launch(node)

    def drop_launch(self, node: str) -> None:
        """Forget a node's launch, since its settings changed."""
        self._launches.pop(node, None)

    def remember(self) -> None:
        """Keep what the next item recalls."""
        taken = {v: self._values.pop(v, None) for v in self._recalled}
        self._before = {v: array for v, array in taken.items() if array is not None}

    def forget(self) -> None:
        """Let the next item be a first one."""
        self._before = {}


def _asked(task: Task) -> dict[str, Value | None]:
    """The values that decide whether a node is idle; None for one that is not of this item."""
    if task.node.is_idle is None:
        return {}
    reads = {name.replace(".", "_"): value for name, value in task.reads.items()}
    return {name: reads.get(name) for name in inspect.signature(task.node.is_idle).parameters}


def _sent(task: Task) -> list[tuple[str, Value, bool]]:
    """The inputs of this item for a device: name, value, and whether that is an array."""
    ports = task.node.inputs
    return [
        (name, task.reads[name], port.kind == "array")
        for name, port in ports.items()
        if name in task.reads and port.kind != "object"
    ]
