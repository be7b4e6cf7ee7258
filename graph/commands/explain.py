"""``tactograph explain``: what would run where, and why, and which results may be on disk."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import click

from tactograph.graph.commands import RunOptions, graph_command, print_table, say

if TYPE_CHECKING:
    from tactograph.graph.plan.draft import Task
    from tactograph.graph.plan.plan import Plan, Step


@graph_command("explain", short_help="Say what would run, where and why.")
@click.option("--all", "every", is_flag=True, help="Every node of the groups, and transfers.")
def command(graph: str, values: tuple[str, ...], every: bool, options: RunOptions) -> None:
    """Print the plan of GRAPH, and which of its results may be on disk.

    The use of a group is one line.  No node runs, so params need no values.
    """
    read = options.read(graph)
    arguments = {**read.placeholders, **read.read_words(values)}
    plan = options.open(read, arguments).plan
    moves = [step for step in plan.steps if step.is_transfer]
    title = f"{read.name} [{read.hash}] on {plan.device or 'the host alone'}"
    steps = [step for step in plan.steps if every or not step.is_transfer]
    rows = [_row(plan, step) for step in steps]
    headings = "node", "op", "back end", "when", "why"
    print_table(title, headings, rows if every else _by_box(rows, plan))
    if moves and not every:
        each = sum(step.stream for step in moves)
        click.echo(
            f"{len(moves)} transfers between host and device, {each} of them for every item; "
            "--all lists them"
        )
    for node_id, value in plan.passed.items():
        say(f"{node_id}: taken out; its readers read {value}")
    for name in plan.unused if every else dict.fromkeys(_idle_box(plan, n) for n in plan.unused):
        say(f"{name}: not run; nothing reads it")
    for line in plan.fallbacks:
        say(f"fallback: {line}")


class _Row(NamedTuple):
    node: str
    op: str
    backend: str
    when: str
    why: str


def _row(plan: Plan, step: Step) -> _Row:
    task = plan.tasks.get(step.name)
    op = task.node.name if task else step.kind
    return _Row(step.name, op, step.backend, _when(step, task), step.why)


def _by_box(rows: Iterable[_Row], plan: Plan) -> Iterator[_Row]:
    """The rows, with those of each outermost use merged."""
    from tactograph.graph.show.sketch import box_around

    boxes: dict[str, list[_Row]] = {}
    for row in rows:
        boxes.setdefault(box_around(row.node, plan.graph.uses), []).append(row)
    for name, inside in boxes.items():
        if name not in plan.graph.uses:
            yield from inside
            continue
        backend = ", ".join(dict.fromkeys(row.backend for row in inside))
        why = "; ".join(dict.fromkeys(part for row in inside for part in row.why.split("; ")))
        whens = ("if needed" if row.when.startswith("if ") else row.when for row in inside)
        when = "; ".join(dict.fromkeys(whens))
        op = f"{plan.graph.uses[name].group}: {len(inside)} nodes"
        yield _Row(name, op, backend, when, why)


def _idle_box(plan: Plan, node_id: str) -> str:
    """The outermost use without a running node around a node; the node itself if there is none."""
    from tactograph.graph.show.sketch import box_around

    running = {use for use in plan.graph.uses if any(n.startswith(f"{use}.") for n in plan.tasks)}
    return box_around(node_id, plan.graph.uses, running)


def _when(step: Step, task: Task | None) -> str:
    """When a step runs, and whether an earlier result may replace it."""
    from tactograph.graph.cache.store import has_stored

    if step.conditions:
        return f"if {' and '.join(map(str, step.conditions))}"
    if step.stream:
        return "every item"
    if task is None or step.on_device or task.looks_outside or not has_stored(task.node):
        return "once"
    return "once, unless on disk"
