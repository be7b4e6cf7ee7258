"""``tactograph tune``: change a graph in the browser while its result is seen."""

import secrets
import socket

import click

from tactograph.graph.commands import backend_option, device_option, graph_command, say


@graph_command("tune", short_help="Change a graph in the browser, and see what it gives.")
@backend_option
@device_option
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
    from tactograph.graph.extras import need
    from tactograph.graph.files.read_graph import read_graph
    from tactograph.graph.files.typed_values import read_words

    given = read_words(read_graph(graph), values)
    need("tune", "tune", "nicegui")
    from tactograph.graph.tune.page import serve
    from tactograph.graph.tune.tuning import Tuning

    number = port or _free_port()
    token = secrets.token_urlsafe(24)
    tuning = Tuning(graph, given, backend=backend, device=device)
    say(f"http://127.0.0.1:{number}/?token={token}")
    say("only this machine reaches the page; Ctrl-C ends it", err=True)
    serve(tuning, port=number, token=token, show=not no_browser)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        number: int = probe.getsockname()[1]
        return number
