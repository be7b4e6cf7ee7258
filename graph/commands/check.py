"""``tactograph check``: verify a graph without running it."""

from __future__ import annotations

from dataclasses import replace

import click


@click.command("check", short_help="Verify a graph without running it.")
@click.argument("graph")
@click.option("--set", "settings", multiple=True, metavar="NODE.PARAM=VALUE")
def command(graph: str, settings: tuple[str, ...]) -> None:
    """Read GRAPH, resolve it, compare types, units and sizes, and list its params."""
    from tactograph.graph.files.read import read_graph
    from tactograph.graph.plan.make_plan import make_plan
    from tactograph.graph.run.open import open_device, placeholders, with_changes
    from tactograph.graph.run.typed_values import read_settings

    read = with_changes(read_graph(graph), read_settings(settings))
    bound = any(entry.backend == "opencl" for entry in read.nodes.values())
    device, reason = open_device(read, None) if bound else (None, "no device was looked for")
    # Where nodes run is not told here, so that nothing is loaded to find out.
    anywhere = replace(read, prefer=("numpy",))
    plan = make_plan(anywhere, placeholders(read), device=device, no_device=reason)
    click.echo(f"{read.name}: {read.title or 'no title'} [{read.hash}]")
    click.echo(f"{len(plan.tasks)} nodes, {len(plan.outputs)} outputs, nothing wrong")
    for unused in plan.unused:
        click.echo(f"not used by any output: {unused}")
    width = max((len(name) for name in read.params), default=0)
    for name, param in read.params.items():
        given = "optional" if param.default is None else f"default {param.default}"
        state = "needed" if param.required else given
        click.echo(f"  {name:<{width}}  {param.kind:<8} {state}; {param.help}")
