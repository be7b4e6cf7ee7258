"""``tactograph nodes``: the nodes there are, or the page of one."""

from __future__ import annotations

import click


@click.command("nodes", short_help="List the nodes, or show one node's page.")
@click.argument("name", required=False)
def command(name: str | None) -> None:
    """List all nodes with their summaries, or print everything about the node NAME."""
    from tactograph.graph.errors import TactographError
    from tactograph.graph.find import find_node, node_names

    if name is not None:
        click.echo(_page(find_node(name)))
        return
    names = node_names()
    width = max(map(len, names))
    for each in names:
        try:
            found = find_node(each)
        except TactographError as error:
            click.echo(f"{each:<{width}}  --  {error}")
            continue
        kernel = "cl" if found.has_kernel else "  "
        click.echo(f"{each:<{width}}  {kernel}  {found.summary}")


def _page(found: object) -> str:
    from tactograph.graph.node import Node

    assert isinstance(found, Node)
    lines = [f"{found.name} (of {found.package})", "", found.doc, "", "Inputs"]
    lines += [f"  {p.name}: {p}" for p in found.inputs.values()] or ["  none: a source"]
    lines += ["", "Parameters"]
    for parameter in found.parameters.values():
        default = "needed" if parameter.required else f"default {parameter.default!r}"
        lines.append(f"  {parameter.name}: {default}")
    lines += ["", "Outputs"]
    lines += [f"  {p.name}: {p}" for p in found.outputs.values()] or ["  none: a sink"]
    kernel = f"kernels/{found.name}.cl" if found.has_kernel else "none"
    lines += ["", f"OpenCL: {kernel}", f"Neutral: {found.neutral}"]
    return "\n".join(lines)
