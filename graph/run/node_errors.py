"""Errors of nodes, in one line that names the node."""

from __future__ import annotations

from tactograph.graph.backends.events import DEVICE_ERROR
from tactograph.graph.errors import DeviceError, EndOfStream, NodeError, TactographError
from tactograph.graph.plan.plan import Task


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
            kind_of = DeviceError if isinstance(error, DEVICE_ERROR) else NodeError
            raise kind_of(
                f"node '{task.id}' ({task.node.name}) failed: {type(error).__name__}: {error}"
            ) from error
