"""``tactograph draw``: the plan as a picture."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click

from tactograph.graph.commands import RunOptions, graph_argument, run_options, say


@click.command("draw", short_help="Draw a graph as DOT, Mermaid or SVG.")
@graph_argument
@click.option(
    "--out", type=click.Path(dir_okay=False, path_type=Path),
    help="File .dot, .mmd or .svg; without it DOT is printed.",
)  # fmt: skip
@click.option("--all", "every", is_flag=True, help="Every node of the groups, and transfers.")
@run_options
def command(
    graph: str,
    out: Path | None,
    every: bool,
    options: RunOptions,
) -> None:
    """Draw the plan of GRAPH, nodes coloured by back end; a group that is used is one box."""
    from tactograph.graph.errors import InputError
    from tactograph.graph.files.atomic_files import atomic_file
    from tactograph.graph.plan.draw import to_dot, to_mermaid
    from tactograph.graph.plan.draw_folded import to_folded_svg
    from tactograph.graph.plan.draw_svg import to_svg

    read = options.read(graph)
    plan = options.open(read, read.placeholders).plan
    if out is None:
        say(to_dot(plan, every=every), nl=False)
        return
    draw: dict[str, Callable[[], str]] = {
        ".dot": lambda: to_dot(plan, every=every),
        ".mmd": lambda: to_mermaid(plan, every=every),
        ".svg": lambda: to_svg(plan) if every else to_folded_svg(plan),
    }
    if out.suffix not in draw:
        raise InputError(f"--out {out}: the name has to end in .dot, .mmd or .svg")
    with atomic_file(out) as target:
        target.write_text(draw[out.suffix](), encoding="utf-8")
