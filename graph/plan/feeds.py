"""Say what feeds a parameter or an input of a node, in words that the user can act on."""

from tactograph.graph.plan.draft import Task, Value
from tactograph.graph.plan.plan import Plan


def feed_of(plan: Plan, task: Task, name: str) -> str | None:
    """What feeds a parameter or input: ``radius_mm=``, ``--set ball.radius_mm=``, or words.

    For an input it is the graph's param that the value comes from: the one that sets a parameter of
    the same name upstream, else the first one of a node that reads a file.  None if the node has no
    such parameter or input.
    """
    if name in task.node.parameters:
        param = _params(task).get(name)
        return f"--set {task.id}.{name}=" if param is None else f"{param}="
    if name not in task.node.inputs:
        return None
    value = task.edges.get(name)
    if value is None:
        return f"input '{name}' of node '{task.id}'"
    param = _param_behind(plan, value, name.rpartition(".")[2])
    return f"input '{name}' from node '{value.node}'" if param is None else f"{param}="


def _params(task: Task) -> dict[str, str]:
    """The graph's params by the node's parameters that they set, in the order of declaration."""
    params = task.entry.params
    return {name: params[name] for name in task.node.parameters if name in params}


def _param_behind(plan: Plan, value: Value, name: str) -> str | None:
    """The graph's param that a value comes from, or None; `name` is the input that reads it."""
    task = plan.tasks[value.node]
    names = {name, value.port}
    params = {} if task.stand_in else _params(task)
    for parameter, param in params.items():
        if any(parameter == each or parameter.startswith(f"{each}_") for each in names):
            return param
    for input_name, read in task.reads.items():
        if input_name in names:
            return _param_behind(plan, read, name)
    is_read = not any(port.kind == "array" for port in task.node.inputs.values())
    for param in params.values():
        if is_read or plan.graph.params[param].kind == "path":
            return param
    for read in task.reads.values():
        return _param_behind(plan, read, name)
    return None
