"""``tactograph graphs``: the graphs that ship."""

from collections.abc import Mapping

import click

from tactograph.graph.commands import say
from tactograph.graph.errors import InputError

FIRST_GRAPHS = "calibrate", "reconstruct", "precise"
"""The graphs to start with, in the order in which they are needed."""


@click.command("graphs", short_help="List the graphs that ship.")
@click.argument("word", required=False)
def command(word: str | None) -> None:
    """List what ships, by folder, with titles: all, or what has WORD in its name or title.

    'tactograph run GRAPH --help' lists the params of one.
    """
    from tactograph.graph.files.read_graph import shipped_titles

    folders = shipped_titles()
    if word is None:
        every = {name: title for titles in folders.values() for name, title in titles.items()}
        first = {name: every[name] for name in FIRST_GRAPHS}
        folders = {"to start with": first, **folders}
    else:
        folders = {folder: _with_word(titles, word) for folder, titles in folders.items()}
        if not any(folders.values()):
            raise InputError(f"no graph has '{word}' in its name or title")
    width = max(len(name) for titles in folders.values() for name in titles)
    for folder, titles in folders.items():
        if titles:
            say(f"{folder}:")
        for name, title in titles.items():
            say(f"  {name:<{width}}  {title}")


def _with_word(titles: Mapping[str, str], word: str) -> dict[str, str]:
    return {n: t for n, t in titles.items() if word.lower() in f"{n} {t}".lower()}
