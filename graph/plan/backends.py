"""Pass 4: decide where each node runs, and record why."""

from tactograph.graph.backends.device_backend import DeviceBackend
from tactograph.graph.declare.kernel_declaration import Obstacle
from tactograph.graph.declare.node import Node
from tactograph.graph.errors import GraphError
from tactograph.graph.plan.draft import Draft, Task
from tactograph.graph.plan.plan import Placement


def place(draft: Draft, device: DeviceBackend | None, no_device: str) -> dict[str, Placement]:
    """Place every node on a back end.

    A node that the graph file binds to a ``backend`` runs there, or is refused.  Any other node
    runs on the first back end of ``prefer`` that can run it, or falls back to NumPy, which is
    recorded.  It is no fallback if the node has no kernel, or if its NumPy function is faster and
    ``prefer`` names numpy.  A node that calls other nodes runs on the host; each of those runs
    where it would run as a node of the graph.

    Raises GraphError if a node is bound to a back end that cannot run it.
    """
    tasks, prefer = draft.tasks.values(), draft.graph.prefer
    return {task.id: _place(task, prefer, device, no_device) for task in tasks}


def _place(
    task: Task, prefer: tuple[str, ...], device: DeviceBackend | None, no_device: str
) -> Placement:
    if task.stand_in:
        return Placement("numpy", "handed in by the caller")
    if task.filled:
        # The constant is made on the device if that is preferred, to save a transfer.
        on_device = device is not None and prefer[0] == "opencl" and task.node.has_kernel
        return Placement("opencl" if on_device else "numpy", "neutral: a constant stands in")
    bound = task.entry.backend
    if bound is None:
        return _preferred(task.node, prefer, device, no_device)
    missing = _obstacle(task.node, device, no_device).missing
    if bound == "opencl" and missing:
        where = task.entry.where("backend")
        raise GraphError(f"{where}: '{task.id}' is bound to {bound}, but {missing}")
    return Placement(bound, "the graph file says so")


def _preferred(
    node: Node, prefer: tuple[str, ...], device: DeviceBackend | None, no_device: str
) -> Placement:
    if prefer[0] == "numpy":
        return Placement("numpy", "preferred")
    if node.has_kernel:
        missing, slower = _obstacle(node, device, no_device)
        # Checked first: what is `missing` does not matter if NumPy is faster anyway.
        if slower and "numpy" in prefer:
            return Placement("numpy", f"faster than on the device: {slower}")
        if missing is None:
            return Placement("opencl", "preferred")
        how = "is preferred" if "numpy" in prefer else "was asked for"
        return Placement("numpy", f"opencl {how}, but {missing}", fallback=True)
    called = {n: _preferred(each, prefer, device, no_device) for n, each in node.calls.items()}
    for placement in called.values():
        if placement.fallback:
            return placement
    on_device = tuple(name for name, placement in called.items() if placement.on_device)
    names = ", ".join(node.calls[name].name for name in on_device)
    why = "has no opencl kernel" + (f"; calls {names} on opencl" if names else "")
    return Placement("numpy", why, calls=on_device)


def _obstacle(node: Node, device: DeviceBackend | None, no_device: str) -> Obstacle:
    """Why a node cannot, or should not, run on the device, if anything."""
    if not node.has_kernel:
        return Obstacle(missing=f"node '{node.name}' has no opencl kernel")
    if device is None:
        return Obstacle(missing=no_device)
    return node.kernels.can_run(device) or Obstacle()
