"""Which nodes make something that does not follow from their settings and inputs alone."""

from __future__ import annotations

from pathlib import Path

from tactograph.graph.plan.draft import Task


def looks_outside(task: Task) -> bool:
    """Whether a node yields, keeps a session, is told of the run, or names a file."""
    node = task.node
    if task.filled:
        return False
    has_file = any(isinstance(value, Path) for value in task.settings.values())
    return node.source or task.stand_in or bool(node.session or node.provenance) or has_file
