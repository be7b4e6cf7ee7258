"""Pass 4: decide where each node runs, and say why."""

from __future__ import annotations

from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.errors import GraphError
from tactograph.graph.plan.draft import Draft, Task
from tactograph.graph.plan.plan import Placement


def place(draft: Draft, device: OpenCL | None, no_device: str) -> dict[str, Placement]:
    """Place every node on a back end.

    A ``backend`` in the graph file is kept or refused.  Otherwise the first back end of
    ``prefer`` that can run the node is taken; taking a later one is a fallback, and recorded.

    Raises
    ------
    GraphError
        If a node is bound to a back end that cannot run it.
    """
    return {
        task.id: _place(task, draft.graph.prefer, device, no_device)
        for task in draft.tasks.values()
    }


def _place(task: Task, prefer: tuple[str, ...], device: OpenCL | None, no_device: str) -> Placement:
    if task.stand_in:
        return Placement("numpy", "handed in by the caller")
    if task.filled:
        # A constant is made where the first preference can hold it.
        on_device = device is not None and prefer[:1] == ("opencl",) and task.node.has_kernel
        return Placement("opencl" if on_device else "numpy", "neutral: a constant stands in")
    bound = task.entry.backend
    if bound is not None:
        obstacle = _obstacle(task, bound, device, no_device)
        if obstacle:
            raise GraphError(
                f"{task.entry.where('backend')}: '{task.id}' is bound to {bound}, but {obstacle}"
            )
        return Placement(bound, "the graph file says so")
    # Also where a library is missing that only the device would need: it would not be used.
    if device is not None and task.node.has_kernel and "numpy" in prefer:
        better = task.node.kernels.better_on_host(device)
        if better:
            return Placement("numpy", f"faster than on a CPU device: {better}")
    return _first_that_can(task, prefer, device, no_device)


def _first_that_can(
    task: Task, prefer: tuple[str, ...], device: OpenCL | None, no_device: str
) -> Placement:
    """Take back ends in order; one that the node is not written for is no fallback."""
    if prefer[:1] != ("opencl",):
        return Placement("numpy", "preferred")
    if not task.node.has_kernel:
        return Placement("numpy", "has no OpenCL kernel")
    obstacle = _obstacle(task, "opencl", device, no_device)
    if obstacle is None:
        return Placement("opencl", "preferred")
    wanted = "is preferred" if "numpy" in prefer else "was asked for"
    return Placement("numpy", f"opencl {wanted}, but {obstacle}", fallback=True)


def _obstacle(task: Task, backend: str, device: OpenCL | None, no_device: str) -> str | None:
    """What keeps a node off a back end, or None."""
    node = task.node
    if backend not in node.backends:
        return f"node '{node.name}' has no OpenCL kernel"
    if backend == "numpy":
        return None
    return no_device if device is None else node.implementations[backend].can_run(device)
