"""Values of the previous item that a plan recalls, if their sizes still fit."""

from collections.abc import Mapping
from typing import Any

from tactograph.graph.errors import warn
from tactograph.graph.plan.draft import Task, Value


def recall(task: Task, name: str, before: Mapping[Value, Any], sizes: Mapping[str, int]) -> Any:
    """The previous item's value of an input; None if there is none, or its size differs."""
    recalled, port = before.get(task.recalls[name]), task.node.inputs[name]
    if recalled is None or port.kind != "array" or port.fits(recalled.shape, sizes):
        return recalled
    warn(f"{task.id}: the image size changed; the node starts again without earlier items")
    return None
