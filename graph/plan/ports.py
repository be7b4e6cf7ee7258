"""Pass 2: check that both ends of every edge have the same type and unit."""

from functools import partial

from tactograph.graph.declare.ports import PortType
from tactograph.graph.errors import ErrorsTogether, GraphError
from tactograph.graph.plan.draft import Draft


def check(draft: Draft) -> None:
    """Compare the types at both ends of every edge.

    Raises GraphError, naming both ports, if kind, element type, number of axes or unit differ.
    """
    edges = [(task.id, name) for task in draft.tasks.values() for name in task.edges]
    ErrorsTogether.of_all(edges, partial(_check_edge, draft))


def _check_edge(draft: Draft, edge: tuple[str, str]) -> None:
    task, name = draft.tasks[edge[0]], edge[1]
    value = task.edges[name]
    due, offered = task.node.inputs[name], draft.port_of(value)
    if clash := _clash(due, offered):
        where = task.entry.where(f"in.{name}")
        raise GraphError(
            f"{where}: '{name}' of {task.node.name} wants {due}, but {value} is "
            f"{offered}: {clash}{draft.graph.stands(value.node, where)}"
        )


def _clash(due: PortType, offered: PortType) -> str | None:
    if due.kind != offered.kind:
        return f"{_a(offered.kind)} is not {_a(due.kind)}"
    if due.kind == "object":
        return None if due.python == offered.python else "the types differ"
    if due.dtype != offered.dtype:
        return "the element types differ"
    if len(due.dims) != len(offered.dims):
        return "the numbers of axes differ"
    if due.unit != offered.unit:
        return "the units differ"
    if offered.optional and not due.optional:
        return "it may be absent"
    return None


def _a(kind: str) -> str:
    return f"an {kind}" if kind[0] in "ao" else f"a {kind}"
