"""Turn a node's exceptions into one line that names the node."""

from functools import partial

from tactograph.graph.errors import (
    DeviceError,
    EndOfStream,
    GraphNames,
    NodeError,
    TactographError,
    is_of_printing,
    message_of,
    of_system,
)
from tactograph.graph.plan.draft import Task
from tactograph.graph.plan.feeds import feed_of
from tactograph.graph.plan.plan import Plan

_PASSED_ON = (TactographError, EndOfStream, KeyboardInterrupt, GeneratorExit)


class Blaming(GraphNames):
    """A block that runs a node of a plan; see `GraphNames`.

    An unexpected exception becomes one line that names the node; so does `SystemExit`, by which a
    node would end the run as a success.  A subclass of `SystemExit` ends the process on purpose, as
    a signal handler does, and is passed on.  `device_error` is the exception type of the device's
    library, for a node on a device.
    """

    __slots__ = ("_device_error", "_task")

    def __init__(
        self, plan: Plan, task: Task, device_error: type[Exception] | tuple[()] = ()
    ) -> None:
        super().__init__(partial(feed_of, plan, task))
        self._task, self._device_error = task, device_error

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        super().__exit__(kind, error, trace)
        ends = isinstance(error, SystemExit) and type(error) is not SystemExit
        if error is not None and not ends and not isinstance(error, _PASSED_ON):
            if isinstance(error, OSError) and is_of_printing(error):
                return
            task = self._task
            if refusal := of_system(error):
                where = f"node '{task.id}' ({task.node.name})"
                raise type(refusal)(f"{where}: {refusal}") from error
            kind_of = DeviceError if isinstance(error, self._device_error) else NodeError
            raise kind_of(
                f"node '{task.id}' ({task.node.name}) failed: {type(error).__name__}: "
                f"{message_of(error)}"
            ) from error
