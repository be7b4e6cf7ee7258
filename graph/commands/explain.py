"""``tactograph explain``: what will run where, and why."""

from __future__ import annotations

import click

from tactograph.graph.commands import (
    GraphCommand,
    RunOptions,
    graph_argument,
    run_options,
    say,
    values_argument,
)


@click.command("explain", cls=GraphCommand, short_help="Say where each node would run, and why.")
@graph_argument
@values_argument
@click.option("--transfers", is_flag=True, help="Every step in order, with the transfers.")
@run_options
def command(
    graph: str,
    values: tuple[str, ...],
    transfers: bool,
    options: RunOptions,
) -> None:
    """Print the plan of GRAPH.  Params that are not given do not matter to the plan."""
    from rich.console import Console
    from rich.table import Table

    from tactograph.graph.run.typed_values import read_words

    read = options.read(graph)
    given = {**read.placeholders, **read_words(read, values)}
    plan = options.open(read, given).plan
    table = Table(title=f"{read.name} [{read.hash}] on {plan.device or 'the host alone'}")
    for heading in ("node", "op", "back end", "when", "why"):
        table.add_column(heading, overflow="fold")
    moves = [step for step in plan.steps if step.is_transfer]
    for step in plan.steps:
        if step in moves and not transfers:
            continue
        task = plan.tasks.get(step.name)
        table.add_row(
            step.name,
            task.node.name if task else step.kind,
            step.backend,
            "every item" if step.stream else "once",
            step.why,
        )
    console = Console(markup=False)
    if not console.is_terminal:
        console.width = 120
    console.print(table)
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
