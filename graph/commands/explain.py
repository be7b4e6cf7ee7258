"""``tactograph explain``: what would run where and why, how long it took, and what is kept."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from tactograph.graph.commands import RunOptions, graph_command, run_options, say
from tactograph.graph.errors import InputError, a_few

if TYPE_CHECKING:
    from tactograph.graph.plan.draft import Task
    from tactograph.graph.plan.plan import Plan, Step
    from tactograph.graph.run.last_times import LastTimes


@graph_command("explain", short_help="Say what would run, where, why and how long.")
@click.option("--all", "every", is_flag=True, help="Every node of the groups, and transfers.")
@click.option(
    "--times", "place", type=click.Path(exists=True, path_type=Path),
    help="An earlier result, or what 'bench --out' wrote.  [default: the results in out=]",
)  # fmt: skip
@run_options
def command(
    graph: str,
    values: tuple[str, ...],
    every: bool,
    place: Path | None,
    options: RunOptions,
) -> None:
    """Print the plan of GRAPH, how long its steps took before, and what may be kept on disk.

    A group that is used is one line.
    Params that are not given do not matter to the plan.  No node runs.
    """
    from tactograph.graph.files.typed_values import read_words

    read = options.read(graph)
    given = {**read.placeholders, **read_words(read, values)}
    plan = options.open(read, given).plan
    moves = [step for step in plan.steps if step.is_transfer]
    title = f"{read.name} [{read.hash}] on {plan.device or 'the host alone'}"
    last = _last_times(plan, place)
    known = last.ms if last else {}
    shown = [step for step in plan.steps if every or not step.is_transfer]
    rows = [_row(plan, step, known) for step in shown]
    _print(title, rows if every else _by_box(rows, plan))
    say(_duration(plan, last))
    if moves and not every:
        each = sum(step.stream for step in moves)
        click.echo(
            f"{len(moves)} transfers between host and device, {each} of them for every item; "
            "--all lists them"
        )
    for node_id, value in plan.passed.items():
        say(f"{node_id}: taken out; its readers read {value}")
    for node_id in plan.unused:
        say(f"{node_id}: not run; nothing reads it")
    for line in plan.fallbacks:
        say(f"fallback: {line}")


def _last_times(plan: Plan, place: Path | None) -> LastTimes | None:
    """The times at a place, or those of the last result in the graph's own folder."""
    from tactograph.graph.run.last_times import find_last_times

    if place is not None:
        return find_last_times(plan, place, same_graph=False)
    param = plan.graph.params.get("out")
    out = plan.given.get("out", param.default if param else None)
    with suppress(InputError):
        if isinstance(out, str | Path):
            return find_last_times(plan, Path(out), same_graph=True)
    return None


def _duration(plan: Plan, last: LastTimes | None) -> str:
    """Time of an item, in one line."""
    if last is None or not last.ms:
        return "how long: not known; run it, or give an earlier result or bench with --times"
    each, once = (
        sum(last.ms.get(step.name, 0.0) for step in plan.steps if step.stream == stream)
        for stream in (True, False)
    )
    unknown = [name for name in plan.tasks if name not in last.ms]
    rest = f"; not known: {a_few(unknown, 3)}" if unknown else ""
    return f"how long: {each:.1f} ms an item and {once:.1f} ms once, as {last.file} says{rest}"


class _Row(NamedTuple):
    node: str
    op: str
    backend: str
    when: str
    ms: float | None
    why: str


def _row(plan: Plan, step: Step, known: Mapping[str, float]) -> _Row:
    task = plan.tasks.get(step.name)
    op = task.node.name if task else step.kind
    when = _when(step, task)
    return _Row(step.name, op, step.backend, when, known.get(step.name), step.why)


def _by_box(rows: Iterable[_Row], plan: Plan) -> Iterator[_Row]:
    """The rows, those of each outermost use in one."""
    from tactograph.graph.show.sketch import box_around

    boxes: dict[str, list[_Row]] = {}
    for row in rows:
        boxes.setdefault(box_around(row.node, plan.graph.uses), []).append(row)
    for name, inside in boxes.items():
        if name not in plan.graph.uses:
            yield from inside
            continue
        took = [row.ms for row in inside if row.ms is not None]
        backend, why = (
            ", ".join(dict.fromkeys(each))
            for each in zip(*((row.backend, row.why) for row in inside), strict=True)
        )
        whens = ("if needed" if row.when.startswith("if ") else row.when for row in inside)
        when = "; ".join(dict.fromkeys(whens))
        op = f"{plan.graph.uses[name].group}: {len(inside)} nodes"
        yield _Row(name, op, backend, when, sum(took) if took else None, why)


def _print(title: str, rows: Iterable[_Row]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title)
    for heading in ("node", "op", "back end", "when", "last ms", "why"):
        table.add_column(heading, overflow="fold")
    for row in rows:
        took = "-" if row.ms is None else f"{row.ms:.2f}"
        table.add_row(row.node, row.op, row.backend, row.when, took, row.why)
    console = Console(markup=False)
    if not console.is_terminal:
        console.width = 120
    console.print(table)


def _when(step: Step, task: Task | None) -> str:
    """Occasion of a step's run, and whether an earlier result may replace it."""
    from tactograph.graph.cache.store import has_stored

    if step.conditions:
        return f"if {' and '.join(map(str, step.conditions))}"
    if step.stream:
        return "every item"
    if task is None or step.on_device or task.looks_outside or not has_stored(task.node):
        return "once"
    return "once, unless on disk"
