"""``tactograph new-node``: write the first files of a node."""

from pathlib import Path

import click

from tactograph.graph.commands import FOLDER_PATH, say


@click.command("new-node", short_help="Write the files of a new node.")
@click.argument("name", metavar="[ROOM/]NAME")
@click.option(
    "--ring", "folder", metavar="FOLDER", default=Path(), type=FOLDER_PATH,
    help="The folder of a ring that holds its nodes.  [default: the clone you are in]",
)  # fmt: skip
def command(name: str, folder: Path) -> None:
    """Write the function, the kernel and the test of a working node NAME, as a start.

    ROOM is its folder below nodes/: capture, light, shadow, slope, height and so on.
    """
    from tactograph.graph.extras import need

    need("report", "new-node", "jinja2")
    from tactograph.graph.declare.new_files import write_node

    files = write_node(name, folder)
    for file in files:
        say(str(file))
    say(f"try it: pytest {files[-1]}")
