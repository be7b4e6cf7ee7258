"""``tactograph draw``: the plan as a picture."""

from __future__ import annotations

from pathlib import Path

import click

from tactograph.graph.commands import RunOptions, run_options, say


@click.command("draw", short_help="Draw a graph as DOT, Mermaid or SVG.")
@click.argument("graph")
@click.option(
    "--out", type=click.Path(dir_okay=False, path_type=Path),
    help="File .dot, .mmd or .svg (needs graphviz); without it DOT is printed.",
)  # fmt: skip
@run_options
def command(
    graph: str,
    out: Path | None,
    options: RunOptions,
) -> None:
    """Draw the plan of GRAPH: nodes by back end, and the transfers between them."""
    from tactograph.graph.errors import InputError
    from tactograph.graph.files.whole_files import whole_file
    from tactograph.graph.plan.draw import to_dot, to_mermaid
    from tactograph.graph.run.open import placeholders

    read = options.read(graph)
    plan = options.open(read, placeholders(read)).plan
    if out is None:
        say(to_dot(plan), nl=False)
        return
    if out.suffix not in (".dot", ".mmd", ".svg"):
        raise InputError(f"--out {out}: the name has to end in .dot, .mmd or .svg")
    text = to_mermaid(plan) if out.suffix == ".mmd" else to_dot(plan)
    if out.suffix == ".svg":
        text = _svg(text)
    with whole_file(out) as target:
        target.write_text(text, encoding="utf-8")


def _svg(dot: str) -> str:
    import shutil
    import subprocess

    from tactograph.graph.errors import InputError

    program = shutil.which("dot")
    if program is None:
        raise InputError("SVG needs graphviz (apt-get install graphviz); .dot and .mmd do not")
    done = subprocess.run([program, "-Tsvg"], input=dot, capture_output=True, text=True, check=True)
    return done.stdout
