"""Completion for a shell: graphs, their params, and values of these.

A shell's script comes from click: ``eval "$(_TACTOGRAPH_COMPLETE=bash_source tactograph)"``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.shell_completion import BashComplete, CompletionItem, add_completion_class

from tactograph.graph.errors import TactographError

if TYPE_CHECKING:
    from tactograph.graph.files.flat_graph import Graph, Param

WORDS_KEY = f"{__name__}.words"
"""The key of a context's entry for the words after a command."""


class _Bash(BashComplete):
    """Click's script, without a blank after a name whose value is still to come."""

    source_template = BashComplete.source_template.replace(
        "    return 0", "    [[ $COMPREPLY == *= ]] && compopt -o nospace\n    return 0"
    )


add_completion_class(_Bash)


def complete_graph(prefix: str, *, studies: bool = False) -> list[CompletionItem]:
    """The shipped graphs (and `studies`) that begin with this text; else files."""
    from tactograph.graph.files.graph_places import shipped
    from tactograph.graph.files.read_graph import shipped_names

    names = [*shipped_names(), *(shipped("studies") if studies else ())]
    items = [CompletionItem(name) for name in names if name.startswith(prefix)]
    return items or [CompletionItem(prefix, type="file")]


def complete_overlay(
    ctx: click.Context, param: click.Parameter, prefix: str
) -> list[CompletionItem]:
    """The variants of a graph, and the overlays that fit it; else files."""
    from tactograph.graph.files.graph_places import shipped

    # Click does not know the graph yet if an option still lacks its value.
    graph = next((word for word in ctx.meta.get(WORDS_KEY, ()) if not word.startswith("-")), None)
    read = _read(graph, ())
    names = {*shipped("overlays"), *(read.variants if read is not None else ())}
    begins = [name for name in sorted(names) if name.startswith(prefix)]
    fits = [name for name in begins if read is None or _read(graph, (name,)) is not None]
    items = [CompletionItem(name) for name in fits]
    return items or [CompletionItem(prefix, type="file")]


def complete_value(ctx: click.Context, param: click.Parameter, prefix: str) -> list[CompletionItem]:
    """Completions after the words behind a graph: ``name=``, or a value.

    zsh and fish give ``name=begun`` as one word, bash as three.
    """
    words = ctx.params.get("values") or ()
    read = _read(ctx.params.get("graph"), ctx.params.get("overlays") or ())
    if read is None:
        return []
    name, equals, text = prefix.partition("=")
    if equals and name in read.params:
        values = _files(text) if read.params[name].kind == "path" else _flags(read.params[name])
        return [CompletionItem(f"{name}={value}") for value in values if value.startswith(text)]
    before = next((word for word in reversed(words) if word != "="), "")
    if before in read.params:
        if read.params[before].kind == "path":
            return [CompletionItem(prefix, type="file")]
        values = _flags(read.params[before])
        return [CompletionItem(value) for value in values if value.startswith(prefix)]
    names = {word.partition("=")[0] for word in words}
    return [
        CompletionItem(f"{name}=", help=param.help)
        for name, param in read.params.items()
        if name.startswith(prefix) and name not in names
    ]


def _read(graph: str | None, overlays: Sequence[str]) -> Graph | None:
    from tactograph.graph.files.read_graph import read_graph, with_overlays

    try:
        return None if graph is None else with_overlays(read_graph(graph), overlays)
    except TactographError:
        return None


def _flags(param: Param) -> list[str]:
    """The values of a flag, none of other params."""
    return ["true", "false"] if param.kind == "flag" else []


def _files(prefix: str) -> list[str]:
    folder, slash, name = prefix.rpartition("/")
    try:
        files = [f for f in Path(folder + slash).iterdir() if f.name.startswith(name)]
    except OSError:
        return []
    return sorted(f"{folder}{slash}{f.name}{'/' if f.is_dir() else ''}" for f in files)
