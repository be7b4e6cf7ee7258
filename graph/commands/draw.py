"""``tactograph draw``: the plan as a picture."""

from pathlib import Path

import click

from tactograph.graph.commands import FILE_PATH, RunOptions, graph_argument, say
from tactograph.graph.errors import InputError


@click.command("draw", short_help="Draw a graph as SVG.")
@graph_argument
@click.option("--out", type=FILE_PATH, help="File .svg; without it the picture is printed.")
@click.option("--all", "every", is_flag=True, help="Every node of the groups.")
@RunOptions.add
def command(graph: str, out: Path | None, every: bool, options: RunOptions) -> None:
    """Draw the plan of GRAPH, nodes coloured by back end; the use of a group is one box."""
    from tactograph.graph.disk.atomic_files import write_file
    from tactograph.graph.plan.sketch import sketch_of
    from tactograph.graph.show.draw_svg import to_svg
    from tactograph.graph.show.sketch import fold

    if out is not None and out.suffix != ".svg":
        raise InputError(f"--out {out}: the name has to end in .svg")
    read = options.read(graph)
    sketch = sketch_of(options.open(read, read.placeholders).plan)
    svg = to_svg(sketch if every else fold(sketch))
    if out is None:
        say(svg, nl=False)
        return
    write_file(out, svg)
