"""``tactograph draw``: the plan as a picture."""

from __future__ import annotations

from pathlib import Path

import click

from tactograph.graph.commands import RunOptions, graph_argument, run_options, say


@click.command("draw", short_help="Draw a graph as DOT, Mermaid or SVG.")
@graph_argument
@click.option(
    "--out", type=click.Path(dir_okay=False, path_type=Path),
    help="File .dot, .mmd or .svg; without it DOT is printed.",
)  # fmt: skip
@run_options
def command(
    graph: str,
    out: Path | None,
    options: RunOptions,
) -> None:
    """Draw the plan of GRAPH: nodes by back end, and the transfers between them."""
    from tactograph.graph.errors import InputError
    from tactograph.graph.files.atomic_files import atomic_file
    from tactograph.graph.plan.draw import to_dot, to_mermaid
    from tactograph.graph.plan.draw_svg import to_svg

    read = options.read(graph)
    plan = options.open(read, read.placeholders).plan
    if out is None:
        say(to_dot(plan), nl=False)
        return
    draw = {".dot": to_dot, ".mmd": to_mermaid, ".svg": to_svg}
    if out.suffix not in draw:
        raise InputError(f"--out {out}: the name has to end in .dot, .mmd or .svg")
    with atomic_file(out) as target:
        target.write_text(draw[out.suffix](plan), encoding="utf-8")
