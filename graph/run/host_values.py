"""Values on the host, and the nodes that make them there."""

import time
from collections.abc import Mapping
from contextlib import ExitStack
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.graph.cache.store import recall_or_make
from tactograph.graph.declare.engine_arguments import Session
from tactograph.graph.declare.ports import PortType
from tactograph.graph.errors import NodeError, as_in_graph
from tactograph.graph.plan.draft import Task, Value
from tactograph.graph.plan.feeds import feed_of
from tactograph.graph.plan.plan import Plan, Step
from tactograph.graph.plan.sizes import Shapes
from tactograph.graph.run.integer_images import (
    as_fractions,
    holds_integers,
    may_give_integers,
    only_device_reads,
)
from tactograph.graph.run.node_errors import Blaming
from tactograph.graph.run.ownership import lent, own
from tactograph.graph.run.previous_values import recall


class HostValues:
    """Values on the host by node and port, those of the previous item, and sessions.

    Every array is read-only: several nodes, and the next item, may read it.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._values: dict[Value, Any] = {}
        self._arriving: dict[Value, Any] = {}
        self._before: dict[Value, Any] = {}
        self._sessions: dict[str, Session] = {}
        self._objects = {task.id: _containers(task) for task in plan.tasks.values()}
        givers = filter(may_give_integers, plan.tasks.values())
        self._only_on_device = {task.id: only_device_reads(plan, task) for task in givers}

    def __getitem__(self, value: Value) -> Any:
        return self._values[value]

    def get(self, value: Value) -> Any:
        """A value; None if it is absent from this item."""
        return self._values.get(value)

    def ready(self, value: Value | None) -> Any:
        """A value if it can be read without waiting, else None."""
        if value is None or value in self._arriving:
            return None
        return self._values.get(value)

    def holds(self, condition: Value) -> bool:
        """Return whether a condition's value is present, and not zero everywhere."""
        if condition in self._arriving:
            self._arriving.pop(condition).wait()
        return self._values[condition] is not None and bool(np.any(self._values[condition]))

    def put(self, value: Value, content: Any) -> None:
        """Enter a value that was computed earlier."""
        self._arriving.pop(value, None)
        self._values[value] = content

    def lent(self, value: Value) -> Any:
        """A value for the caller; lists and mappings are copied."""
        return lent(self._values[value])

    def recall(self, task: Task, name: str, sizes: Mapping[str, int]) -> Any:
        """The previous item's value of an input, or None; see `recall`."""
        return recall(task, name, self._before, sizes)

    def receive(self, value: Value, array: NDArray[Any], arrived: Any) -> None:
        """Enter an array that is complete after an event, which readers on the host wait for."""
        array.flags.writeable = False
        self._values[value] = array
        self._arriving[value] = arrived

    def all_arrived(self) -> None:
        """Forget the events of transfers: all have arrived."""
        self._arriving.clear()

    def fill(self, task: Task, sizes: Mapping[str, int]) -> None:
        """Make the constant that stands in for a node."""
        port, shape, dtype, neutral = constant(task, sizes)
        array = self._values[Value(task.id, port)] = np.full(shape, neutral, dtype)
        array.flags.writeable = False

    def run(
        self, task: Task, step: Step, sizes: Mapping[str, int], keywords: Mapping[str, Any]
    ) -> tuple[Any, float]:
        """Call a node's function; return its result and the milliseconds that it took.

        `keywords` are arguments in addition to settings, session and wanted outputs.
        """
        node = task.node
        keywords = {**task.settings, **self.session(task), **keywords}
        if node.wanted is not None:
            keywords[node.wanted] = self._plan.wanted[task.id]
        recalled = {name: self.recall(task, name, sizes) for name in task.recalls}
        for value in step.reads if self._arriving else ():
            if value in self._arriving:
                self._arriving.pop(value).wait()
        start = time.perf_counter()
        with Blaming(self._plan, task):
            inputs = {name: self._values[value] for name, value in task.reads.items()} | recalled
            for name in self._objects[task.id]:
                inputs[name] = lent(inputs.get(name))
            arguments = node.in_order(inputs)
            if step.stream or task.looks_outside:
                result = node(*arguments, **keywords)
            else:
                make = partial(node, *arguments, **keywords)
                result = recall_or_make(node, keywords, arguments, make)
        return result, 1e3 * (time.perf_counter() - start)

    def enter(self, task: Task, step: Step, output: Any) -> Shapes:
        """Enter the result of a node, or what a caller handed in; return the arrays' shapes."""
        shapes: Shapes = {}
        with Blaming(self._plan, task):
            results = task.node.results(output)
        for value, result in zip(step.writes, results, strict=True):
            port = task.node.outputs[value.port]
            unread = task.node.wanted is not None and port.name not in self._plan.wanted[task.id]
            if port.kind == "array" and not (result is None and (port.optional or unread)):
                if not (task.id in self._only_on_device and holds_integers(result)):
                    result = _as_declared(task, port, result)
                elif not self._only_on_device[task.id]:
                    result = as_fractions(result)
                result.flags.writeable = False
                shapes[value.port] = result.shape
            self._values[value] = _in_graph(self._plan, task, result)
        return shapes

    def session(self, task: Task) -> dict[str, Session]:
        """The session of a node as a keyword argument, if it takes one."""
        if task.node.session is None:
            return {}
        return {task.node.session: self._sessions.setdefault(task.id, Session())}

    def integer_keyword(self, source: Task) -> dict[str, bool]:
        """The keyword argument that tells a source whether its images may stay integers."""
        keyword = source.node.integers
        return {} if keyword is None else {keyword: self._only_on_device[source.id]}

    def remember(self) -> None:
        """Keep the values that the next item recalls."""
        values = self._values
        self._before = {v: own(values[v]) for v in self._plan.recalled if v in values}

    def forget(self) -> None:
        """Treat the next item as the first."""
        self._before = {}

    @property
    def sessions(self) -> list[str]:
        """The nodes that have a session."""
        return list(self._sessions)

    def close(self) -> None:
        """Close the sessions."""
        sessions, self._sessions = self._sessions, {}
        with ExitStack() as stack:
            for session in sessions.values():
                stack.callback(session.close)


def _in_graph(plan: Plan, task: Task, result: Any) -> Any:
    """A result whose sentences name the graph's params instead of the node's parameters."""
    if isinstance(result, str):
        return as_in_graph(result, partial(feed_of, plan, task))
    if isinstance(result, list):
        return [_in_graph(plan, task, each) for each in result]
    return result


def constant(
    task: Task, sizes: Mapping[str, int]
) -> tuple[str, tuple[int, ...], np.dtype[Any], float]:
    """Port, shape, dtype and value of the constant that stands in for a node."""
    (port,) = task.node.outputs
    dtype, neutral = task.node.outputs[port].dtype, task.node.neutral
    assert dtype is not None
    assert isinstance(neutral, int | float)
    return port, task.node.output_shape(port, sizes), dtype, neutral


def _containers(task: Task) -> list[str]:
    """The inputs that may be lists or mappings, which a reader could change."""
    ports = task.node.inputs.items()
    return [name for name, port in ports if port.kind == "object" and port.python is not str]


def _as_declared(task: Task, port: PortType, array: NDArray[Any]) -> NDArray[Any]:
    actual = f"a {type(array).__name__}"
    if isinstance(array, np.ndarray):
        if port.fits(array.shape) and array.dtype == port.dtype:
            return np.ascontiguousarray(array)
        actual = f"{array.dtype} of shape {array.shape}"
    declared = f"declares {port} as '{port.name}'"
    raise NodeError(f"node '{task.id}' ({task.node.name}) {declared} but returned {actual}")
