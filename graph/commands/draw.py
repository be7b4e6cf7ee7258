"""``tactograph draw``: the plan as a picture."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tactograph.graph.commands import FILE_PATH, RunOptions, graph_argument, run_options, say
from tactograph.graph.errors import InputError

if TYPE_CHECKING:
    from tactograph.graph.show.sketch import Sketch


@click.command("draw", short_help="Draw a graph as Mermaid or SVG.")
@graph_argument
@click.option("--out", type=FILE_PATH, help="File .mmd or .svg; without it Mermaid is printed.")
@click.option("--all", "every", is_flag=True, help="Every node of the groups, and transfers.")
@run_options
def command(graph: str, out: Path | None, every: bool, options: RunOptions) -> None:
    """Draw the plan of GRAPH, nodes coloured by back end; a group that is used is one box."""
    from tactograph.graph.disk.atomic_files import atomic_file
    from tactograph.graph.plan.sketch import sketch_of
    from tactograph.graph.show.draw_mermaid import to_mermaid
    from tactograph.graph.show.draw_svg import to_svg
    from tactograph.graph.show.sketch import fold

    read = options.read(graph)
    sketch = sketch_of(options.open(read, read.placeholders).plan, transfers=every)
    sketch = sketch if every else fold(sketch)
    if out is None:
        say(to_mermaid(sketch), nl=False)
        return
    draw: dict[str, Callable[[Sketch], str]] = {".mmd": to_mermaid, ".svg": to_svg}
    if out.suffix not in draw:
        raise InputError(f"--out {out}: the name has to end in .mmd or .svg")
    with atomic_file(out) as target:
        target.write_text(draw[out.suffix](sketch), encoding="utf-8")
