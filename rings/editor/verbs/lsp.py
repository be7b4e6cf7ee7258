"""``tactograph lsp``: the language server of graph files, over standard input and output."""

import click

from tactograph.sdk import need


@click.command("lsp", short_help="Help an editor with graph files (a language server).")
def command() -> None:
    """Serve an editor that starts this command and talks to it by the Language Server Protocol.

    It completes names, ports and params, explains them, finds definitions, and checks while you
    type.
    """
    need("editor", "tactograph lsp", "pygls")
    from tactograph.rings.editor.server import server

    server.start_io()
