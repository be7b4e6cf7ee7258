"""``tactograph nodes``: the nodes there are, or the page of one."""

import click

from tactograph.graph.commands import say


@click.command("nodes", short_help="List the nodes, or show one node's page.")
@click.argument("name", required=False)
def command(name: str | None) -> None:
    """List all nodes with their summaries, or print everything about the node NAME."""
    from tactograph.graph.declare.find_node import builtin_rooms, find_node, node_names
    from tactograph.graph.declare.node_page import node_page
    from tactograph.graph.errors import TactographError

    if name is not None:
        say(node_page(find_node(name)))
        return
    rooms = builtin_rooms()
    names = sorted(node_names(), key=lambda name: (rooms.get(name, "~"), name))
    width = max(map(len, names))
    room = None
    for each in names:
        if rooms.get(each) != room:
            room = rooms.get(each)
            say(f"\n{room or 'of other packages'}")
        try:
            node = find_node(each)
        except TactographError as error:
            say(f"  {each:<{width}}  --  {error}")
            continue
        kernels = " ".join(node.implementations)
        say(f"  {each:<{width}}  {kernels:<6}  {node.summary}")
