"""Values as a user types them, for params of graphs (`Graph.read_words`) and for ``--set``."""

from collections.abc import Iterable
from typing import Any

from tactograph.graph.disk.strict_yaml import Document
from tactograph.graph.disk.text_names import at_home
from tactograph.graph.errors import InputError, a_few
from tactograph.graph.files.graph_model import KIND_VALUES, is_of_kind
from tactograph.graph.files.graph_places import shipped

MAX_NAMED_SETTINGS = 3
"""Largest number of nodes' parameters of one name that a message names."""


def overlays_with(*, param: str = "", node: str = "") -> str:
    """The shipped overlays with that param, or that insert that node, as for ``--with``."""
    documents = {each: Document.read(file).data for each, file in shipped("overlays").items()}
    overlays = [
        f"--with {overlay}"
        for overlay, data in documents.items()
        if param in data.get("params", {})
        or node in [change.get("insert", ()) for change in data.get("patch", [])]
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


def read_value(name: str, text: str, kind: str, *, required: bool) -> Any:
    """Read a value of a param of this kind.  Raises InputError if it is of another."""
    if kind == "path" and not text:
        raise InputError(f"{name}=: a path is needed")
    if kind == "path":
        return at_home(text)
    if kind == "text":
        return text
    if not required and text and _scalar(name, text) is None:
        return None
    if kind == "numbers":
        return [_number(f"{name}={text}", part) for part in text.split(",")]
    value = _scalar(name, text)
    if not is_of_kind(value, kind):
        raise InputError(f"{name}={text}: {KIND_VALUES[kind][0]} is needed")
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
