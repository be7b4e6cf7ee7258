"""``tactograph new-ring``: write a package that brings nodes, graphs and commands."""

from pathlib import Path

import click

from tactograph.graph.commands import FOLDER_PATH, say


@click.command("new-ring", short_help="Write a package of your own: a ring.")
@click.argument("folder", type=FOLDER_PATH)
@click.option("--node", "name", default="brighten", show_default=True, help="Its first node.")
def command(folder: Path, name: str) -> None:
    """Write into FOLDER a package with a node, its kernel, a graph, a command and tests.

    Once it is installed, 'tactograph' finds its contents by place and file name.
    """
    from tactograph.graph.extras import need

    need("report", "new-ring", "jinja2")
    from tactograph.graph.declare.new_files import write_ring

    for file in write_ring(folder, name):
        say(str(file))
    say(f"try it: pip install -e '{folder}[test]' && pytest {folder}")
