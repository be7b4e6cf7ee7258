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
        # The constant is made on the first preferred back end, to save a transfer.
        why = "neutral: a constant stands in"
        backend = "numpy" if device is None or prefer[0] == "numpy" else device.backend
        return Placement(backend if backend in task.node.backends else "numpy", why)
    bound = task.entry.backend
    if bound is not None:
        obstacle = _obstacle(task.node, bound, device, no_device)
        if obstacle is not None and obstacle.missing:
            where = task.entry.where("backend")
            raise GraphError(f"{where}: '{task.id}' is bound to {bound}, but {obstacle.missing}")
        return Placement(bound, "the graph file says so")
    return _preferred(task.node, prefer, device, no_device)


def _preferred(
    node: Node, prefer: tuple[str, ...], device: DeviceBackend | None, no_device: str
) -> Placement:
    refusals: list[str] = []
    for backend in prefer:
        if backend == "numpy":
            break
        if backend not in node.implementations:
            continue
        obstacle = _obstacle(node, backend, device, no_device) or Obstacle()
        # Checked first: what is `missing` does not matter if NumPy is faster anyway.
        if obstacle.slower and "numpy" in prefer:
            return Placement("numpy", f"faster than on the device: {obstacle.slower}")
        if obstacle.missing is None:
            return Placement(backend, "; ".join(refusals) or "preferred", fallback=bool(refusals))
        how = "is preferred" if "numpy" in prefer else "was asked for"
        refusals.append(f"{backend} {how}, but {obstacle.missing}")
    if refusals:
        return Placement("numpy", "; ".join(refusals), fallback=True)
    why = "preferred" if prefer[0] == "numpy" else f"has no {prefer[0]} kernel"
    called = {n: _preferred(each, prefer, device, no_device) for n, each in node.calls.items()}
    for placement in called.values():
        if placement.fallback:
            return placement
    on_device = tuple(name for name, placement in called.items() if placement.on_device)
    if on_device:
        why += f"; calls {', '.join(node.calls[name].name for name in on_device)} on {prefer[0]}"
    return Placement("numpy", why, calls=on_device)


def _obstacle(
    node: Node, backend: str, device: DeviceBackend | None, no_device: str
) -> Obstacle | None:
    """Why a node cannot, or should not, run on a back end; None if it can."""
    if backend == "numpy":
        return None
    if backend not in node.implementations:
        return Obstacle(missing=f"node '{node.name}' has no {backend} kernel")
    if device is None or device.backend != backend:
        return Obstacle(missing=no_device)
    return node.implementations[backend].can_run(device)
