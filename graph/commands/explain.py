"""``tactograph explain``: what will run where, and why."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import click

from tactograph.graph.commands import RunOptions, graph_command, run_options, say

if TYPE_CHECKING:
    from tactograph.graph.plan.plan import Plan, Step


@graph_command("explain", short_help="Say where each node would run, and why.")
@click.option("--transfers", is_flag=True, help="Every step in order, with the transfers.")
@run_options
def command(
    graph: str,
    values: tuple[str, ...],
    transfers: bool,
    options: RunOptions,
) -> None:
    """Print the plan of GRAPH.  Params that are not given do not matter to the plan."""
    from tactograph.graph.run.typed_values import read_words

    read = options.read(graph)
    given = {**read.placeholders, **read_words(read, values)}
    plan = options.open(read, given).plan
    moves = [step for step in plan.steps if step.is_transfer]
    title = f"{read.name} [{read.hash}] on {plan.device or 'the host alone'}"
    _print_steps(title, plan, [step for step in plan.steps if transfers or step not in moves])
    if moves and not transfers:
        each = sum(step.stream for step in moves)
        click.echo(
            f"{len(moves)} transfers between host and device, {each} of them for every item; "
            "--transfers lists them"
        )
    for node_id, value in plan.passed.items():
        say(f"{node_id}: taken out; its readers read {value}")
    for node_id in plan.unused:
        say(f"{node_id}: not run; nothing reads it")
    for line in plan.fallbacks:
        say(f"fallback: {line}")


def _print_steps(title: str, plan: Plan, steps: Iterable[Step]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title)
    for heading in ("node", "op", "back end", "when", "why"):
        table.add_column(heading, overflow="fold")
    for step in steps:
        op = plan.tasks[step.name].node.name if step.name in plan.tasks else step.kind
        when = "every item" if step.stream else "once"
        table.add_row(step.name, op, step.backend, when, step.why)
    console = Console(markup=False)
    if not console.is_terminal:
        console.width = 120
    console.print(table)
