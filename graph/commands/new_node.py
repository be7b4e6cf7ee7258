"""``tactograph new-node``: write the first files of a node."""

from pathlib import Path

import click

from tactograph.graph.commands import say


@click.command("new-node", short_help="Write the files of a new node.")
@click.argument("name", metavar="[ROOM/]NAME")
@click.option(
    "--package", metavar="FOLDER", type=click.Path(file_okay=False, path_type=Path),
    help="A package of your own, made if it is not there.  [default: the clone you are in]",
)  # fmt: skip
def command(name: str, package: Path | None) -> None:
    """Write the function, the kernel and the tests of a node NAME that works, to be edited.

    ROOM is the folder of nodes/ it goes to: capture, light, shadow, slope, height and others.
    """
    from tactograph.graph.extras import need

    need("report", "new-node", "jinja2")
    from tactograph.graph.declare.new_node import write_into_package, write_into_project

    if package is None:
        files, line = write_into_project(name, Path()), ""
    else:
        files, line = write_into_package(name, package)
    for file in files:
        say(str(file))
    if line:
        say(f"add to {package}/pyproject.toml, then install again: {line}")
    elif package is not None:
        say(f"try it: pip install -e '{package}[test]' && pytest {package}")
    else:
        say(f"try it: pytest {files[-1]} tests/kernels -k {files[0].stem}")
