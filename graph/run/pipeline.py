"""Run a plan: item by item, host and device, with the time of every step."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from statistics import median
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from tactograph.graph.backends.launch import DeviceArray
from tactograph.graph.backends.opencl import OpenCL, has_failed, milliseconds
from tactograph.graph.backends.prepared import Prepared, Timer
from tactograph.graph.declare.ports import PortType
from tactograph.graph.declare.provenance import Provenance, versions
from tactograph.graph.declare.session import Session
from tactograph.graph.errors import (
    DeviceError,
    EndOfStream,
    InputError,
    NodeError,
    TactographError,
    collect_warnings,
    warn,
)
from tactograph.graph.plan.names import settings_of
from tactograph.graph.plan.plan import Plan, Step, Task, Value
from tactograph.graph.plan.sizes import Known, Shapes, Sized


@dataclass(eq=False)
class Result(Mapping[str, Any]):
    """What one item gave: the graph's outputs by name, and how long each step took.

    Arrays are read-only: the pipeline may still hold them, for the next item or for all.
    `times` is in milliseconds, by step.  `item` is what the stream's source yielded; `total`
    the milliseconds from there to the last output, as a clock on the wall sees them.
    """

    outputs: dict[str, Any]
    times: dict[str, float]
    plan: Plan
    warnings: list[str] = field(default_factory=list)
    item: dict[Value, Any] = field(default_factory=dict)
    total: float = 0.0

    def __getitem__(self, name: str) -> Any:
        if name not in self.outputs:
            raise KeyError(f"no output {name!r}; there are {', '.join(self.outputs) or 'none'}")
        return self.outputs[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.outputs)

    def __len__(self) -> int:
        return len(self.outputs)


class Pipeline:
    """A verified, planned and compiled graph that keeps its buffers from call to call.

    One pipeline belongs to one thread; several threads use one each, and a second one at the
    same time is refused.  Closing it, or leaving its ``with`` block, ends the stream and closes
    what its nodes keep; after that it is of no more use.
    """

    def __init__(self, plan: Plan, device: OpenCL | None) -> None:
        self.plan = plan
        self._turn = _Turn(plan.graph.name)
        self._device = device
        self._host: dict[Value, Any] = {}
        self._remote: dict[Value, DeviceArray] = {}
        self._arriving: dict[Value, Any] = {}
        self._known: Known = {}
        self._sized: dict[str, Sized] = {}
        self._launches: dict[str, Prepared] = {}
        self._times: dict[str, float] = {}
        self._notes: list[str] = []
        self._lasting = 0
        self._wanted = {name: plan.wanted(name) for name in plan.tasks}
        self._sent = {task.id: _sent(task) for task in plan.tasks.values()}
        self._recalled = {v for t in plan.tasks.values() for v in t.recalls.values()}
        self._host_before: dict[Value, Any] = {}
        self._remote_before: dict[Value, DeviceArray] = {}
        self._sessions: dict[str, Session] = {}
        self._iterator: Iterator[Any] | None = None
        self._running: object | None = None
        self._total = 0.0
        self._prepared = False
        self._ended = False
        tasks = plan.tasks.values()
        self._source = next((t for t in tasks if t.node.stream and not t.stand_in), None)
        self._stand_ins = {task.id: self._goes_up(task) for task in tasks if task.stand_in}
        self._objects = {task.id: _containers(task) for task in tasks}
        made = {Value(t.id, port) for t in tasks if t.stand_in for port in t.node.outputs}
        self._read_whole = {value for value in made if self._is_read_whole(value)}
        self._once = self._split(stream=False)
        self._stream = self._split(stream=True)
        for task in tasks:
            on_device = plan.placements[task.id].backend == "opencl" and not task.filled
            if device is not None and on_device:
                device.compile(task.node)

    def __call__(self, /, **stand_ins: NDArray[Any]) -> Result:
        """Run one item, arrays standing in for source nodes, and return its outputs.

        The arrays may be refilled afterwards: neither the result nor the pipeline holds them.

        Parameters
        ----------
        **stand_ins
            By source node: a K x H x W stack of images.  Unsigned integers count as
            fractions of their full scale, floats as they are.

        Raises
        ------
        InputError
            If a source that the pipeline was planned without is missing, sizes clash, the
            pipeline was closed, or another thread is using it.
        """
        if self._source is not None:
            raise InputError(
                f"{self.plan.graph.name}: '{self._source.id}' yields a stream of its own; "
                "go through items()"
            )
        if self._stand_ins.keys() != stand_ins.keys():
            raise InputError(
                f"{self.plan.graph.name}: arrays are needed for {sorted(self._stand_ins)}, "
                f"and were given for {sorted(stand_ins)}"
            )
        with self._turn:
            self._prepare()
            self._begin()
            stacks = {name: _checked_stack(array).view() for name, array in stand_ins.items()}
            result = self._item({n: self._stand_in(n, stack) for n, stack in stacks.items()})
            # What a node passes on is still the caller's own memory.
            for name, value in result.outputs.items():
                if isinstance(value, np.ndarray) and _shares(value, stacks.values()):
                    result.outputs[name] = _own(value)
            result.item = {}
            return result

    def items(self, repeats: int = 1) -> Iterator[Result]:
        """Run every item of the graph's stream, sinks included.

        The stream ends with its source, or after an item at which a sink raised `EndOfStream`;
        then it can be run again.

        Parameters
        ----------
        repeats
            How often each item is computed; above 1, the times are medians over all runs
            but the first, which compiles and fills caches.  Sinks run once.

        Raises
        ------
        InputError
            If the pipeline was closed, is going through its stream already, or another thread
            is using it.
        """
        if self._stand_ins:
            waiting = ", ".join(sorted(self._stand_ins))
            raise InputError(f"{self.plan.graph.name}: call the pipeline with arrays for {waiting}")
        with self._turn:
            if self._running is not None:
                raise InputError(
                    f"{self.plan.graph.name}: the pipeline is going through its stream already; "
                    "end that first, or load the graph once more"
                )
            mine = self._running = object()
        try:
            with self._turn:
                self._prepare()
            if self._source is None:
                with self._turn:
                    result = self._item({}, repeats)
                yield result
            else:
                yield from self._all_items(self._source, repeats, mine)
        finally:
            if self._running is mine:
                self._end()

    def _all_items(self, source: Task, repeats: int, mine: object) -> Iterator[Result]:
        keywords = {**source.settings, **self._session(source)}
        self._ended = False
        with collect_warnings(self._notes), Blaming(source):
            iterator = self._iterator = iter(source.node(**keywords))
        while not self._ended and self._running is mine:
            with self._turn:
                self._begin()
                start = time.perf_counter()
                with collect_warnings(self._notes), Blaming(source):
                    item = next(iterator, None)
                if item is None:
                    return
                self._times[source.id] = 1e3 * (time.perf_counter() - start)
                result = self._item({source.id: item}, repeats)
            yield result

    @property
    def buffers(self) -> int:
        """How many buffers were ever allocated on the device; a steady stream adds none."""
        return self._device.buffers if self._device is not None else 0

    @property
    def endless(self) -> bool:
        """Whether the stream only ends when it is stopped."""
        return any(task.node.endless for task in self.plan.tasks.values())

    def aim(self, /, **values: Any) -> None:
        """Give other values to params of the graph that only what runs per item takes.

        So a pipeline goes on to another capture, or another folder for its results, with
        its calibration, plan and kernels kept.

        Raises
        ------
        InputError
            If the graph has no such param, or what runs once depends on it.
        """
        graph, given = self.plan.graph, {**self.plan.given, **values}
        for name in values:
            if name not in graph.params:
                raise InputError(f"{graph.name} has no parameter '{name}'")
        words = {f"${name}" for name in values}
        settings: dict[str, dict[str, Any]] = {}
        for task in self.plan.tasks.values():
            used = [v for v in task.entry.settings.values() if isinstance(v, str) and v in words]
            if used and not task.stream:
                raise InputError(
                    f"{graph.name}: '{task.id}' runs once and takes {used[0]}; "
                    "it cannot differ from item to item"
                )
            if used:
                settings[task.id] = settings_of(task.entry, graph, task.node, given)
        # Only now that nothing is refused.
        with self._turn:
            self.plan.given = given
            for name, found in settings.items():
                self.plan.tasks[name].settings = found
            # Sizes and launches may follow from settings.
            self._sized, self._launches = {}, {}

    def forget(self) -> None:
        """Let the next item be a first one: nothing came before it."""
        with self._turn:
            self._host_before, self._remote_before = {}, {}

    def close(self) -> None:
        """End the stream, and close what the nodes keep; the pipeline is of no more use.

        Raises
        ------
        InputError
            If another thread is using it.
        """
        if self._turn.end():
            self._end()

    def _end(self) -> None:
        """End the stream, and close what the nodes keep."""
        iterator, self._iterator = self._iterator, None
        sessions, self._sessions = self._sessions, {}
        self._running = None
        self._host_before, self._remote_before = {}, {}
        # What runs once and keeps something has to open it again.
        if any(not self.plan.tasks[name].stream for name in sessions):
            self._prepared = False
        with ExitStack() as stack:
            for session in sessions.values():
                stack.callback(session.close)
            if iterator is not None and hasattr(iterator, "close"):
                stack.callback(iterator.close)

    def __enter__(self) -> Pipeline:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _begin(self) -> None:
        """Forget the warnings of the item before, but not those of what ran once."""
        del self._notes[self._lasting :]

    def _session(self, task: Task) -> dict[str, Session]:
        """The keyword argument by which a node gets at what it keeps, if it asks for it."""
        if task.node.session is None:
            return {}
        return {task.node.session: self._sessions.setdefault(task.id, Session())}

    def _prepare(self) -> None:
        """Run, once, what does not depend on the stream."""
        if not self._prepared:
            self._begin()
            self._known, self._prepared = self._steps(self._once, {}, {}), True
            self._lasting = len(self._notes)

    def _item(self, given: Mapping[str, Any], repeats: int = 1) -> Result:
        self._steps(self._stream, self._known, given, repeats)
        outputs = {name: _lent(self._host[value]) for name, value in self.plan.outputs.items()}
        yielded = [
            Value(name, port) for name in given for port in self.plan.tasks[name].node.outputs
        ]
        item = {value: self._host[value] for value in yielded}
        self._remember()
        return Result(outputs, dict(self._times), self.plan, list(self._notes), item, self._total)

    def _remember(self) -> None:
        """Keep what the next item recalls."""
        self._host_before = {v: _own(self._host[v]) for v in self._recalled if v in self._host}
        taken = {v: self._remote.pop(v, None) for v in self._recalled}
        self._remote_before = {v: array for v, array in taken.items() if array is not None}

    def _recall(self, task: Task, name: str, sizes: Mapping[str, int], *, remote: bool) -> Any:
        """The value of an input at the item before; None for a first item."""
        before: Mapping[Value, Any] = self._remote_before if remote else self._host_before
        found, port = before.get(task.recalls[name]), task.node.inputs[name]
        if found is None or port.kind != "array":
            return found
        pairs = zip(port.dims, found.shape, strict=True)
        if all(size == (d if isinstance(d, int) else sizes.get(d, size)) for d, size in pairs):
            return found
        warn(f"{task.id}: the images have another size than before; it starts afresh")
        return None

    def _steps(
        self,
        steps: tuple[list[Step], list[Step]],
        known: Known,
        given: Mapping[str, Any],
        repeats: int = 1,
    ) -> Known:
        """Run steps in order; sinks last, when every time is known."""
        computing, sinks = steps
        before = known
        runs: list[dict[str, float]] = []
        totals: list[float] = []
        with collect_warnings(self._notes):
            for _ in range(repeats):
                start = time.perf_counter()
                known = self._compute(computing, before, given)
                totals.append(1e3 * (time.perf_counter() - start))
                if repeats > 1:
                    runs.append(dict(self._times))
            self._total = median(totals[1:] or totals)
            for name in self._times if runs else ():
                self._times[name] = median(run[name] for run in runs[1:])
            for step in sinks:
                try:
                    known = self._execute(step, known, {}, given)
                except EndOfStream:
                    # The other sinks take this item, too.
                    self._ended = True
        return known

    def _compute(self, steps: list[Step], known: Known, given: Mapping[str, Any]) -> Known:
        timers: dict[str, Timer] = {}
        doing = ""
        try:
            for step in steps:
                doing = step.name
                known = self._execute(step, known, timers, given)
            if timers and self._device is not None:
                doing = ""
                self._device.finish()
                for name, timer in timers.items():
                    self._times[name] = milliseconds(timer)
        except (cl.Error, DeviceError) as error:
            raise self._device_error(error, doing, timers) from error
        finally:
            self._arriving.clear()
        return known

    def _device_error(
        self, error: Exception, doing: str, timers: Mapping[str, Timer]
    ) -> DeviceError:
        """Name the steps that failed: a device tells of them long after they began."""
        failed = [name for name, timer in timers.items() if has_failed(timer)]
        if isinstance(error, DeviceError) and not failed:
            return error
        named = ", ".join(map(self._in_words, failed or ([doing] if doing else timers)))
        return DeviceError(f"{self.plan.device} failed at {named}: {error}")

    def _in_words(self, step: str) -> str:
        task = self.plan.tasks.get(step)
        return f"'{step}'" if task is None else f"'{step}' ({task.node.name})"

    def _split(self, *, stream: bool) -> tuple[list[Step], list[Step]]:
        """The steps that compute and the sinks, of the stream or of what runs once."""
        steps = [step for step in self.plan.steps if step.stream == stream]
        sinks = [s for s in steps if s.kind == "run" and self.plan.tasks[s.name].node.sink]
        return [step for step in steps if step not in sinks], sinks

    def _stand_in(self, name: str, stack: NDArray[Any]) -> Any:
        record = self.plan.tasks[name].node.output_record
        if stack.dtype.kind == "u" and not self._stand_ins[name]:
            stack = np.asarray(stack / np.float32(np.iinfo(stack.dtype).max), np.float32)
        return stack if record is None else record(stack)

    def _goes_up(self, task: Task) -> bool:
        """Whether the device alone reads a source's images, so that they go there as they came."""
        value = Value(task.id, next(iter(task.node.outputs)))
        readers = [step for step in self.plan.steps if value in step.reads]
        host = value in self.plan.outputs.values() or value in self._recalled
        return not host and bool(readers) and all(step.backend == "opencl" for step in readers)

    def _is_read_whole(self, value: Value) -> bool:
        """Whether every reader's kernel takes a camera's integers."""
        return all(
            task.node.whole == name
            for task in self.plan.tasks.values()
            for name, found in task.edges.items()
            if found == value and not task.filled
        )

    def _execute(
        self,
        step: Step,
        known: Known,
        timers: dict[str, Timer],
        given: Mapping[str, Any],
    ) -> Known:
        """Run one step; return the sizes that are known behind it."""
        if step.kind in ("upload", "download"):
            self._transfer(step, timers)
        else:
            task = self.plan.tasks[step.name]
            sized = self.plan.sizes.around(task, known, self._sized.get(task.id))
            self._sized[task.id] = sized
            if step.kind == "fill":
                shapes = self._fill(task, step, sized.sizes)
            elif step.backend == "opencl":
                shapes = self._launch(task, step, sized.sizes, timers)
            else:
                shapes = self._run(task, step, sized, given)
            known = self.plan.sizes.behind(task, sized, shapes)
        for value in step.release:
            self._remote.pop(value, None)
        return known

    def _transfer(self, step: Step, timers: dict[str, Timer]) -> None:
        """Begin a transfer; whoever reads on the host waits, the device keeps its own order."""
        assert self._device is not None
        (value,) = step.reads
        if step.kind == "download":
            array, timer = self._device.start_download(self._remote[value])
            array.flags.writeable = False
            self._host[value] = array
            self._arriving[value] = timer[1]
        elif (array := self._host[value]) is not None:
            port = self.plan.tasks[value.node].node.outputs[value.port]
            as_float = array.dtype != port.dtype and value not in self._read_whole
            device = self._device
            start = device.start_upload_of_fraction if as_float else device.start_upload
            self._remote[value], timer = start(array)
        else:
            # One may be left there by an item that failed.
            self._remote.pop(value, None)
            return
        timers[step.name] = timer

    def _fill(self, task: Task, step: Step, sizes: Mapping[str, int]) -> Shapes:
        (port,) = task.node.outputs
        shape = task.node.output_shape(port, sizes)
        dtype = task.node.outputs[port].dtype
        assert dtype is not None
        assert isinstance(task.node.neutral, int | float)
        value = Value(task.id, port)
        if step.backend == "opencl":
            assert self._device is not None
            self._remote[value] = self._device.fill(shape, dtype, task.node.neutral)
        else:
            array = self._host[value] = np.full(shape, task.node.neutral, dtype)
            array.flags.writeable = False
        self._times[task.id] = 0.0
        return {}

    def _launch(
        self, task: Task, step: Step, sizes: Mapping[str, int], timers: dict[str, Timer]
    ) -> Shapes:
        assert self._device is not None
        inputs = {
            name: self._remote.get(value) if is_array else self._host[value]
            for name, value, is_array in self._sent[task.id]
        }
        for name in task.recalls:
            port = task.node.inputs[name]
            found = self._recall(task, name, sizes, remote=port.kind == "array")
            inputs[name] = found
            if isinstance(found, DeviceArray):
                # A size that only the data tell is that of the item before.
                before = zip(port.dims, found.shape, strict=True)
                sizes = {**{d: n for d, n in before if isinstance(d, str)}, **sizes}
        launch = self._launches.get(task.id)
        with Blaming(task):
            if launch is None or launch.sizes != sizes:
                wanted = self._wanted[task.id]
                launch = self._device.prepare(task.node, task.settings, sizes, wanted)
                self._launches[task.id] = launch
            outputs, timers[task.id] = launch.launch(inputs)
        for value in step.writes:
            if value.port in outputs:
                self._remote[value] = outputs[value.port]
        if launch.shapes is not None:
            return launch.shapes
        return {name: array.shape for name, array in outputs.items()}

    def _run(self, task: Task, step: Step, sized: Sized, given: Mapping[str, Any]) -> Shapes:
        if task.id in given:
            made = given[task.id]
        else:
            keywords = {**task.settings, **self._session(task)}
            recalled = {n: self._recall(task, n, sized.sizes, remote=False) for n in task.recalls}
            if task.node.wanted is not None:
                keywords[task.node.wanted] = self._wanted[task.id]
            if task.node.provenance is not None:
                keywords[task.node.provenance] = self._provenance(sized.derived)
            for value in step.reads if self._arriving else ():
                if value in self._arriving:
                    self._arriving.pop(value).wait()
            start = time.perf_counter()
            with Blaming(task):
                made = task.node(
                    *_positional(task, self._host, recalled, self._objects[task.id]), **keywords
                )
            self._times[task.id] = 1e3 * (time.perf_counter() - start)
        shapes: Shapes = {}
        for value, result in zip(step.writes, _results(task, made), strict=True):
            port = task.node.outputs[value.port]
            if port.kind == "array" and (result is not None or not self._may_lack(task, port)):
                if not (task.stand_in and _is_whole(result)):
                    result = _as_declared(task, port, result)
                # Its readers share it; the next item, or all of them, may yet read it.
                result.flags.writeable = False
                shapes[value.port] = result.shape
            self._host[value] = result
        return shapes

    def _may_lack(self, task: Task, port: PortType) -> bool:
        """Whether a node need not make an output."""
        unread = task.node.wanted is not None and port.name not in self._wanted[task.id]
        return port.optional or unread

    def _provenance(self, known: Known) -> Provenance:
        """What is known at this moment of the run, for a sink that writes it down."""
        sizes: dict[str, int] = {}
        for (_, symbol), bound in known.items():
            sizes.setdefault(symbol, bound.size)
        return Provenance(
            graph={
                "name": self.plan.graph.name,
                "title": self.plan.graph.title,
                "hash": self.plan.graph.hash,
            },
            device=self.plan.device,
            nodes=[self._timed(step) for step in self.plan.steps if step.name in self._times],
            sizes=sizes,
            versions=versions(),
            warnings=list(self._notes),
            fallbacks=self.plan.fallbacks,
        )

    def _timed(self, step: Step) -> dict[str, Any]:
        task = self.plan.tasks.get(step.name)
        return {
            "node": step.name,
            "op": task.node.name if task else step.kind,
            "backend": step.backend,
            "once": not step.stream,
            "ms": round(self._times[step.name], 4),
            "why": step.why,
        }


class _Turn:
    """Lets one thread at a time into a pipeline, and nobody once it is closed.

    A lock that is never waited for: it costs less than a microsecond an item.
    """

    __slots__ = ("_closed", "_lock", "_name")

    def __init__(self, name: str) -> None:
        self._name = name
        self._lock = threading.Lock()
        self._closed = False

    def __enter__(self) -> None:
        self._take()
        if self._closed:
            self._lock.release()
            raise InputError(f"{self._name}: the pipeline was closed; load the graph again")

    def __exit__(self, *_: object) -> None:
        self._lock.release()

    def end(self) -> bool:
        """Let nobody in any more; return whether that is new."""
        self._take()
        was_open, self._closed = not self._closed, True
        self._lock.release()
        return was_open

    def _take(self) -> None:
        if not self._lock.acquire(blocking=False):
            raise InputError(
                f"{self._name}: the pipeline is at work already; it belongs to one thread, so "
                "load one for each"
            )


class Blaming:
    """Turn an unexpected exception of a node into one line that names the node."""

    __slots__ = ("_task",)

    def __init__(self, task: Task) -> None:
        self._task = task

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, Exception) and not isinstance(error, (TactographError, EndOfStream)):
            task = self._task
            kind_of = DeviceError if isinstance(error, cl.Error) else NodeError
            raise kind_of(
                f"node '{task.id}' ({task.node.name}) failed: {type(error).__name__}: {error}"
            ) from error


def _sent(task: Task) -> list[tuple[str, Value, bool]]:
    """What a device is handed of this item: name, value, and whether that is an array."""
    ports = task.node.inputs
    return [
        (name, task.reads[name], port.kind == "array")
        for name, port in ports.items()
        if name in task.reads and port.kind != "object"
    ]


def _containers(task: Task) -> list[str]:
    """The inputs that may be lists or mappings, which any reader could change."""
    ports = task.node.inputs.items()
    return [name for name, port in ports if port.kind == "object" and port.python is not str]


def _positional(
    task: Task,
    host: Mapping[Value, Any],
    recalled: Mapping[str, Any],
    containers: Sequence[str],
) -> list[Any]:
    """The node's positional arguments, of this item and of the one before."""
    reads = task.reads
    inputs = {n: host[reads[n]] if n in reads else recalled.get(n) for n in task.node.inputs}
    for name in containers:
        inputs[name] = _lent(inputs[name])
    return task.node.in_order(inputs)


def _lent(value: Any) -> Any:
    """What others are handed: arrays are read-only, of lists and mappings they get a copy."""
    if isinstance(value, dict):
        return {key: _lent(each) for key, each in value.items()}
    return [_lent(each) for each in value] if isinstance(value, list) else value


def _own(value: Any) -> Any:
    """A copy in memory that nobody else holds."""
    if not isinstance(value, np.ndarray):
        return _lent(value)
    kept = value.copy()
    kept.flags.writeable = False
    return kept


def _shares(array: NDArray[Any], others: Iterable[NDArray[Any]]) -> bool:
    return any(np.may_share_memory(array, other) for other in others)


def _results(task: Task, made: Any) -> tuple[Any, ...]:
    """What a node made, in the order of its outputs."""
    if task.node.sink:
        return ()
    return made if task.node.output_record is not None else (made,)


def _as_declared(task: Task, port: PortType, array: NDArray[Any]) -> NDArray[Any]:
    name = port.name
    if not isinstance(array, np.ndarray):
        raise NodeError(
            f"node '{task.id}' ({task.node.name}) declares {port} as '{name}' "
            f"but made a {type(array).__name__}"
        )
    if array.dtype != port.dtype or array.ndim != len(port.dims):
        raise NodeError(
            f"node '{task.id}' ({task.node.name}) declares {port} as '{name}' "
            f"but made {array.dtype} of shape {array.shape}"
        )
    for dim, size in zip(port.dims, array.shape, strict=True):
        if isinstance(dim, int) and dim != size:
            raise NodeError(f"node '{task.id}' declares {port} but made shape {array.shape}")
    return np.ascontiguousarray(array)


def _is_whole(array: Any) -> bool:
    """Whether light that was handed in is still the camera's unsigned integers."""
    return isinstance(array, np.ndarray) and array.ndim == 3 and array.dtype.kind == "u"


def _checked_stack(array: NDArray[Any]) -> NDArray[Any]:
    """K x H x W: 8 or 16 bits as they came, everything else as float32."""
    found = np.asarray(array)
    if found.ndim != 3:
        raise InputError(f"a stack of images is K x H x W, not of shape {found.shape}")
    if not found.size:
        raise InputError(f"a stack of images of shape {found.shape} holds no pixel")
    if found.dtype in (np.uint8, np.uint16):
        return found
    if found.dtype.kind == "u":
        return np.asarray(found / np.float32(np.iinfo(found.dtype).max), np.float32)
    if found.dtype.kind != "f":
        raise InputError(f"a stack of images is of unsigned integers or floats, not {found.dtype}")
    if not np.isfinite(found).all():
        raise InputError("the stack of images holds NaN or infinite values")
    return np.asarray(found, np.float32)
