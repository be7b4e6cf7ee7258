"""Keep images as the camera's unsigned integers if only kernels read them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.graph.plan.draft import Task, Value
from tactograph.graph.plan.plan import Plan


def integer_values(plan: Plan) -> set[Value]:
    """The images that may stay integers, since every reader's kernel takes integers.

    They come from callers, from sources, and from idle nodes that pass them on.
    """
    tasks = [t for t in plan.tasks.values() if may_give_integers(t) or t.node.is_idle is not None]
    values = {Value(task.id, port) for task in tasks for port in task.node.outputs}
    needed = {*plan.outputs.values(), *plan.recalled}
    sources = {value for value in values if may_give_integers(plan.tasks[value.node])}
    return {value for value in sources | (values - needed) if _readers_take_integers(plan, value)}


def may_give_integers(task: Task) -> bool:
    """Return whether a caller or a source may yield images as integers."""
    return task.stand_in or task.node.integers is not None


def only_device_reads(plan: Plan, task: Task) -> bool:
    """Return whether only the device reads a source's images, so that they can stay integers."""
    value = Value(task.id, next(iter(task.node.outputs)))
    readers = [step for step in plan.steps if value in step.reads]
    host = value in plan.outputs.values() or value in plan.recalled
    return not host and bool(readers) and all(step.on_device for step in readers)


def _readers_take_integers(plan: Plan, value: Value) -> bool:
    return all(
        plan.placements[task.id].on_device and task.node.reads_integers(name)
        for task in plan.tasks.values()
        for name, read in task.edges.items()
        if read == value and not task.filled
    )


def holds_integers(array: Any) -> bool:
    """Return whether an array holds images as unsigned integers."""
    return isinstance(array, np.ndarray) and array.ndim == 3 and array.dtype.kind == "u"


def in_fractions(task: Task, result: Any) -> Any:
    """A task's result; integer images become fractions of full scale."""
    return as_fractions(result) if may_give_integers(task) and holds_integers(result) else result


def as_fractions(array: NDArray[Any]) -> NDArray[np.float32]:
    """Unsigned integers as fractions of their full scale."""
    return np.asarray(array / np.float32(np.iinfo(array.dtype).max), np.float32)
