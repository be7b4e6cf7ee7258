"""``tactograph graphs``: the graphs that ship."""

import click

from tactograph.graph.commands import say


@click.command("graphs", short_help="List the graphs that ship.")
def command() -> None:
    """List what ships, by folder, with titles; 'tactograph check GRAPH' lists the params."""
    from tactograph.graph.files.read_graph import shipped_titles

    folders = shipped_titles()
    width = max(len(name) for folder in folders.values() for name in folder)
    for folder, titles in folders.items():
        say(f"{folder}:")
        for name, title in titles.items():
            say(f"  {name:<{width}}  {title}")
