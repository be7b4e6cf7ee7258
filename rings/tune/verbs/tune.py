"""``tactograph tune``: change a graph in the browser while its result is seen."""

import secrets
import socket

import click

from tactograph.sdk import graph_command, need


@graph_command(
    "tune", plans=False, short_help="Change a graph in the browser, and see what it gives."
)
@click.option("--backend", help="Run on numpy or opencl instead of the graph's preference.")
@click.option("--device", metavar="TEXT", help="Part of the OpenCL device's name.")
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Default: a free one.")
@click.option("--no-browser", is_flag=True, help="Only print the address.")
def command(
    graph: str,
    values: tuple[str, ...],
    backend: str | None,
    device: str | None,
    port: int,
    no_browser: bool,
) -> None:
    """Open GRAPH on a page of this machine: its nodes, their parameters, its result.

    Values are given as NAME=VALUE, as to 'run'.  Nothing is written but what is saved.
    """
    # Readers of graphs take longer to load than all that --help needs.
    from tactograph.sdk import read_graph

    params = read_graph(graph).read_words(values)
    need("tune", "tune", "nicegui")
    from tactograph.rings.tune.page import serve
    from tactograph.rings.tune.tuning import Tuning

    number = port or _free_port()
    token = secrets.token_urlsafe(24)
    tuning = Tuning(graph, params, backend=backend, device=device)
    click.echo(f"http://127.0.0.1:{number}/?token={token}")
    click.echo("only this machine reaches the page; Ctrl-C ends it", err=True)
    serve(tuning, port=number, token=token, show=not no_browser)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        number: int = probe.getsockname()[1]
        return number
