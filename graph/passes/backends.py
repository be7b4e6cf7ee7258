"""Pass 4: decide where each node runs, and say why."""

from __future__ import annotations

import importlib.util

from tactograph.graph.backends.opencl import OpenCL
from tactograph.graph.errors import GraphError
from tactograph.graph.plan import Draft, Placement, Task


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
    obstacle = _obstacle(task, device, no_device)
    if task.entry.backend == "numpy":
        return Placement("numpy", "the graph file says so")
    if task.entry.backend == "opencl":
        if obstacle:
            raise GraphError(
                f"{task.entry.where('backend')}: '{task.id}' is bound to opencl, but {obstacle}"
            )
        return Placement("opencl", "the graph file says so")
    if not task.node.has_kernel:
        return Placement("numpy", "has no OpenCL kernel")
    # Also where a library is missing that only the device would need: it would not be used.
    if task.node.on_cpu and device and device.is_cpu and "numpy" in prefer:
        return Placement("numpy", f"faster than on a CPU device: {task.node.on_cpu}")
    for rank, backend in enumerate(prefer):
        if backend == "numpy":
            why = "preferred" if rank == 0 else f"opencl is preferred, but {obstacle}"
            return Placement("numpy", why, fallback=rank > 0)
        if obstacle is None:
            return Placement("opencl", "preferred" if rank == 0 else "the next preference")
    return Placement("numpy", f"opencl was asked for, but {obstacle}", fallback=True)


def _obstacle(task: Task, device: OpenCL | None, no_device: str) -> str | None:
    """What keeps a node off the device, or None."""
    if not task.node.has_kernel:
        return f"node '{task.node.name}' has no OpenCL kernel"
    if device is None:
        return no_device
    if task.node.requires is not None and not (task.node.in_place and device.shares_memory):
        module, remedy = task.node.requires
        if importlib.util.find_spec(module) is None:
            return f"{module} is not installed ({remedy})"
    return None
