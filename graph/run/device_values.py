"""Values on the device: transfers, launches and their times."""

import inspect
from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from tactograph.graph.backends.arrays import DeviceArray, Timer
from tactograph.graph.backends.device_backend import DeviceBackend
from tactograph.graph.declare.engine_arguments import Wanted
from tactograph.graph.plan.draft import Task, Value
from tactograph.graph.plan.plan import Plan, Step
from tactograph.graph.plan.repeats import first_alike
from tactograph.graph.plan.sizes import Shapes
from tactograph.graph.run.host_values import HostValues, constant
from tactograph.graph.run.integer_images import integer_values
from tactograph.graph.run.node_errors import Blaming
from tactograph.graph.run.previous_values import recall

if TYPE_CHECKING:
    from tactograph.graph.backends.prepared_node import Prepared


class DeviceValues:
    """The buffers on the device by value, those of the previous item, and the prepared launches.

    `caller_arrays` are arrays on the device that the caller handed in; the host has views of them.
    """

    def __init__(self, plan: Plan, device: DeviceBackend, host: HostValues) -> None:
        self._plan, self._device, self._host = plan, device, host
        self.caller_arrays: Mapping[Value, DeviceArray] = {}
        self._values: dict[Value, DeviceArray] = {}
        self._before: dict[Value, DeviceArray] = {}
        self._launches: dict[str, Prepared] = {}
        self._timers: dict[str, Timer] = {}
        self._idle: list[str] = []
        self._integer_values = integer_values(plan)
        self._sent = {task.id: _sent(task) for task in plan.tasks.values()}
        self._idle_inputs = {task.id: _idle_inputs(task) for task in plan.tasks.values()}
        self._first = first_alike(plan)
        self._to_repeat: dict[str, dict[str, DeviceArray]] = {}
        runs = [step.name for step in plan.steps if step.kind == "run" and step.on_device]
        device.compile([plan.tasks[name].node for name in runs])

    @property
    def serial(self) -> str:
        """Unique identifier of the device and its compiled kernels."""
        return self._device.serial

    def get(self, value: Value) -> DeviceArray | None:
        """A value on the device; None if it is absent from this item."""
        return self._values.get(value)

    def put(self, value: Value, array: DeviceArray | None) -> None:
        """Enter a value that was computed earlier."""
        self._values.pop(value, None)
        if array is not None:
            self._values[value] = array

    def download(self, source: DeviceArray) -> NDArray[Any]:
        """A copy of an array on the host, read-only."""
        array = self._device.download(source)
        array.flags.writeable = False
        return array

    def drop(self, values: Iterable[Value]) -> None:
        """Release the buffers of values that no later step reads."""
        for value in values:
            self._values.pop(value, None)

    def begin(self) -> None:
        """Start timing."""
        self._timers, self._idle, self._to_repeat = {}, [], {}

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
            as_float = array.dtype != port.dtype and value not in self._integer_values
            device = self._device
            if value in self.caller_arrays and not as_float:
                self._values[value] = self.caller_arrays[value]
                return
            start = device.start_upload_of_fraction if as_float else device.start_upload
            self._values[value], timer = start(array)
        else:
            # A failed item may have left an array.
            self._values.pop(value, None)
            return
        self._timers[step.name] = timer

    def fill(self, task: Task, sizes: Mapping[str, int]) -> None:
        """Make the constant that stands in for a node."""
        port, shape, dtype, neutral = constant(task, sizes)
        self._values[Value(task.id, port)] = self._device.fill(shape, dtype, neutral)

    def _hand_on(self, task: Task) -> Shapes | None:
        """Pass on existing values instead of running a node; return None if it must run."""
        handed_on = self._compute_first(task) if task.id in self._first else None
        if handed_on is None and self._is_idle(task):
            handed_on = self._read(task)
        if handed_on is None:
            return None
        self._values |= {Value(task.id, name): array for name, array in handed_on.items()}
        self._idle.append(task.id)
        return {name: array.shape for name, array in handed_on.items()}

    def _read(self, task: Task) -> dict[str, DeviceArray] | None:
        """What an idle node returns: inputs by output, or {} if its outputs are absent.

        None if an input has another type than the output declares.
        """
        arrays: dict[str, DeviceArray] = {}
        if all(port.optional for port in task.node.outputs.values()):
            for name in task.node.outputs:
                self._values.pop(Value(task.id, name), None)
            return arrays
        for name, port in task.node.outputs.items():
            read = task.reads.get(task.node.handed_on(name))
            array = None if read is None else self._values.get(read)
            value = Value(task.id, name)
            as_float = value in self._plan.inspected or value not in self._integer_values
            if array is None or (as_float and array.dtype != port.dtype):
                return None
            arrays[name] = array
        return arrays

    def _compute_first(self, task: Task) -> dict[str, DeviceArray] | None:
        """The outputs of the node that this one repeats; None if the two differ for this item."""
        first = self._plan.tasks[self._first[task.id]]
        differing = [value for _, value in first.reads.items() ^ task.reads.items()]
        if first.settings != task.settings or any(map(self._counts, differing)):
            return None
        results, wanted = self._to_repeat.pop(first.id, {}), self._plan.wanted[task.id]
        return results if all(n in results for n in task.node.outputs if n in wanted) else None

    def _counts(self, value: Value) -> bool:
        """Whether a value is present, and not the 0 that kernels get for an absent number."""
        return value in self._values or bool(self._host.ready(value))

    def _is_idle(self, task: Task) -> bool:
        """Return whether a node is idle; False if finding out would mean waiting for a transfer."""
        is_idle, (needed, absent) = task.node.is_idle, self._idle_inputs[task.id]
        if is_idle is None or any(value in self._values for value in absent):
            return False
        values = {name: self._host.ready(value) for name, value in needed.items()}
        return all(value is not None for value in values.values()) and is_idle(**values)

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
                # A size that depends on the data is the previous item's.
                before = zip(port.dims, recalled.shape, strict=True)
                sizes = {**{d: n for d, n in before if isinstance(d, str)}, **sizes}
        launch = self._launches.get(task.id)
        with Blaming(self._plan, task, self._device.error):
            if launch is None or launch.sizes != sizes:
                wanted = self._wanted_here(task.id)
                launch = self._device.prepare(task.node, task.settings, sizes, wanted)
                self._launches[task.id] = launch
            outputs, self._timers[task.id] = launch.launch(inputs)
        if task.id in self._first.values():
            self._to_repeat[task.id] = dict(outputs)
        self._values |= {v: outputs[v.port] for v in step.writes if v.port in outputs}
        if launch.shapes is not None:
            return launch.shapes
        return {name: array.shape for name, array in outputs.items()}

    def _wanted_here(self, node: str) -> Wanted:
        """The outputs of a node that are read, its own or those of a node that repeats it."""
        names = node, *(other for other, first in self._first.items() if first == node)
        return Wanted(frozenset().union(*(self._plan.wanted[name].names or () for name in names)))

    def finish(self) -> dict[str, float]:
        """Wait for the device; return milliseconds by step."""
        if self._timers:
            self._device.finish()
        times = {name: self._device.milliseconds(timer) for name, timer in self._timers.items()}
        return {**times, **dict.fromkeys(self._idle, 0.0)}

    def failed(self) -> list[str]:
        """The steps that failed; a device reports a failure long after the step began."""
        return [name for name, timer in self._timers.items() if self._device.has_failed(timer)]

    @property
    def timed_steps(self) -> list[str]:
        """The steps that are timed."""
        return list(self._timers)

    def drop_launch(self, node: str) -> None:
        """Forget the prepared launch of a node whose settings or wanted outputs changed."""
        self._launches.pop(node, None)

    def lent(self, values: Collection[Value], *, cached: bool) -> dict[Value, Any]:
        """Values as arrays of the device's library, copied if anything else uses their memory.

        `cached` means that a cache holds all values.
        """
        free = set() if cached else {v for v in values if self._plan.tasks[v.node].stream}
        free -= self._plan.recalled
        in_use = [*self.caller_arrays.values(), *self._before.values()]
        in_use += [array for value, array in self._values.items() if value not in free]
        numbers = {array.memory.number for array in in_use}
        lent: dict[Value, Any] = dict.fromkeys(values)
        for value in lent:
            if (array := self._values.get(value)) is not None:
                mine = self._device.copied(array) if array.memory.number in numbers else array
                numbers.add(mine.memory.number)
                lent[value] = self._device.lent(mine)
        self.drop(free)
        return lent

    def remember(self) -> None:
        """Keep the values that the next item recalls; copy the caller's, which may be refilled."""
        recalled = {v: self._values.pop(v, None) for v in self._plan.recalled}
        numbers = {array.memory.number for array in self.caller_arrays.values()}
        self._before = {
            v: self._device.copied(array) if array.memory.number in numbers else array
            for v, array in recalled.items()
            if array is not None
        }

    def forget(self) -> None:
        """Treat the next item as the first."""
        self._before = {}


def _idle_inputs(task: Task) -> tuple[dict[str, Value | None], list[Value]]:
    """What decides whether a node is idle: the predicate's inputs, and values that must be absent.

    An input that is not of this item is None.
    """
    if task.node.is_idle is None:
        return {}, []
    reads = {name.replace(".", "_"): value for name, value in task.reads.items()}
    arguments = inspect.signature(task.node.is_idle).parameters.values()
    values = {a.name: reads.get(a.name) for a in arguments if a.default is a.empty}
    return values, [reads[a.name] for a in arguments if a.name in reads and a.name not in values]


def _sent(task: Task) -> list[tuple[str, Value, bool]]:
    """The inputs of this item that a kernel takes: name, value, and whether it is an array."""
    return [
        (name, task.reads[name], port.kind == "array")
        for name, port in task.node.inputs.items()
        if name in task.reads and port.kind != "object"
    ]
