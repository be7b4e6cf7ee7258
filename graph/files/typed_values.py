"""Values as a user types them: ``name=value`` words, read for a graph's params."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from tactograph.graph.declare.find_node import find_node
from tactograph.graph.disk.strict_yaml import Document
from tactograph.graph.disk.text_names import at_home
from tactograph.graph.errors import InputError, a_few
from tactograph.graph.files.graph_model import WANTED_BY_KIND, is_of_kind
from tactograph.graph.files.graph_places import shipped

if TYPE_CHECKING:
    from tactograph.graph.files.flat_graph import Graph, Param

MAX_NAMED_SETTINGS = 3
"""Largest number of nodes' parameters of one name that a message names."""


def read_words(graph: Graph, words: Iterable[str]) -> dict[str, Any]:
    """See `Graph.read_words`."""
    values: dict[str, Any] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals:
            raise InputError(f"'{word}': {_how_to_write(graph, word)}")
        if name not in graph.params and (settings := settings_called(graph, name)):
            raise InputError(f"{graph.name} has no param '{name}', but nodes have: {settings}")
        if name not in graph.params and (overlays := overlays_with(name)):
            raise InputError(f"{graph.name} has no param '{name}', but overlays add it: {overlays}")
        graph.check_param(name)
        if name in values:
            raise InputError(f"{name} is given twice")
        values[name] = _read(name, text, graph.params[name])
    return values


def _how_to_write(graph: Graph, word: str) -> str:
    """How to write a word without a name, with the graph's first param as an example."""
    first = next(iter(graph.params), "name")
    example = f"{word}=VALUE" if word in graph.params else f"{first}={word}"
    return f"write values as name=value, such as {example}"


def settings_called(graph: Graph, name: str) -> str:
    """The parameters of that name in all nodes, as for ``--set``; "" if there is none."""
    nodes = [
        node_id
        for node_id, entry in graph.nodes.items()
        if name in find_node(entry.op, graph.own).parameters
    ]
    return a_few([f"--set {node_id}.{name}=VALUE" for node_id in nodes], MAX_NAMED_SETTINGS)


def overlays_with(name: str) -> str:
    """The shipped overlays with a param of that name, as for ``--with``; "" if there is none."""
    overlays = [
        f"--with {overlay}"
        for overlay, file in shipped("overlays").items()
        if name in Document.read(file).data.get("params", {})
    ]
    return a_few(overlays, MAX_NAMED_SETTINGS)


def read_settings(words: Iterable[str]) -> dict[str, Any]:
    """Read ``node.param=value`` words of ``--set``.

    Raises InputError if a word is not of that form.
    """
    settings: dict[str, Any] = {}
    for word in words:
        target, equals, text = word.partition("=")
        if not equals or "." not in target:
            raise InputError(f"--set {word}: write it as node.param=value")
        settings[target] = _scalar(f"--set {target}", text)
    return settings


def _read(name: str, text: str, param: Param) -> Any:
    if param.kind == "path" and not text:
        raise InputError(f"{name}=: a path is needed")
    if param.kind == "path":
        return at_home(text)
    if param.kind == "text":
        return text
    if not param.required and text and _scalar(name, text) is None:
        return None
    if param.kind == "numbers":
        return [_number(f"{name}={text}", part) for part in text.split(",")]
    value = _scalar(name, text)
    if not is_of_kind(value, param.kind):
        raise InputError(f"{name}={text}: {WANTED_BY_KIND[param.kind]} is needed")
    return value


def _scalar(name: str, text: str) -> Any:
    try:
        return Document.scalar(text)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def _number(name: str, text: str) -> float:
    value = _scalar(name, text.strip())
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{name}: a number is needed, not '{text}'; write several as 160,120")
    return value
