"""New settings for the nodes of a plan: all are checked first, then applied together."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from tactograph.graph.errors import InputError
from tactograph.graph.files.changes import with_changes
from tactograph.graph.files.flat_graph import Graph
from tactograph.graph.files.groups import meant_nodes
from tactograph.graph.plan.names import settings_of
from tactograph.graph.plan.plan import Plan


class NewSettings(NamedTuple):
    """A changed graph, the values of its params, and the new settings by node."""

    graph: Graph
    arguments: Mapping[str, Any]
    settings: Mapping[str, dict[str, Any]]

    def apply(self, plan: Plan) -> None:
        """Write these settings into a plan."""
        plan.graph, plan.arguments = self.graph, self.arguments
        for name, settings in self.settings.items():
            task = plan.tasks[name]
            task.entry, task.settings = self.graph.nodes[name], settings


def with_parameters(plan: Plan, node: str, parameters: Mapping[str, Any]) -> NewSettings:
    """Change parameters of a node, or of all nodes that a name stands for; see `Pipeline.set`."""
    if not isinstance(node, str):
        raise InputError(f"set: {node!r} is not a node's name")
    before = plan.graph
    changes = {f"{node}.{name}": value for name, value in parameters.items()}
    graph = with_changes(before, changes, "set")
    if not meant_nodes(graph, node):
        graph.entry(node)
    settings = {
        name: settings_of(graph.nodes[name], graph, task.node, plan.arguments)
        for name, task in plan.tasks.items()
        if graph.nodes[name] != before.nodes[name] and not task.stand_in
    }
    return NewSettings(graph, plan.arguments, settings)


def with_values(plan: Plan, values: Mapping[str, Any]) -> NewSettings:
    """Change values of the graph's params; see `Pipeline.aim`."""
    graph, arguments = plan.graph, {**plan.arguments, **values}
    for name in values:
        graph.check_param(name)
    settings: dict[str, dict[str, Any]] = {}
    for task in plan.tasks.values():
        used = [param for param in task.entry.params.values() if param in values]
        if used and not task.stream:
            raise InputError(
                f"{graph.name}: '{task.id}' runs once and takes ${used[0]}; "
                "it cannot differ from item to item"
            )
        if used:
            settings[task.id] = settings_of(task.entry, graph, task.node, arguments)
    return NewSettings(graph, arguments, settings)
