"""``tactograph nodes``: list all nodes, or show the page of one."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import click

from tactograph.graph.commands import say
from tactograph.graph.errors import TactographError

if TYPE_CHECKING:
    from tactograph.graph.declare.find_node import NodePlace


@click.command("nodes", short_help="List the nodes, or show one node's page.")
@click.argument("name", required=False)
def command(name: str | None) -> None:
    """List all nodes with their summaries, or print everything about the node NAME."""
    from tactograph.graph.declare.find_node import find_node, node_places
    from tactograph.graph.declare.node_page import node_page

    if name is not None:
        say(node_page(find_node(name)))
        return
    places = node_places()
    width = max(map(len, places))
    headings = {each: _heading(place) for each, place in places.items()}
    in_order = sorted(places, key=lambda each: (headings[each], each))
    for (_, heading), names in itertools.groupby(in_order, headings.__getitem__):
        say(f"\n{heading}")
        for each in names:
            try:
                node = find_node(each)
            except TactographError as error:
                say(f"  {each:<{width}}  --  {error}")
                continue
            kernels = "opencl" if node.has_kernel else ""
            say(f"  {each:<{width}}  {kernels:<6}  {node.summary}")


def _heading(place: NodePlace) -> tuple[bool, str]:
    """Rooms of the core come first, those of a ring under its name."""
    ring = place.ring.name
    return ring != "core", place.room if ring == "core" else f"{ring}: {place.room}".rstrip(": ")
