"""YAML without surprises: plain data, YAML 1.2 scalars, and the place of every value.

Tags, anchors, aliases, merge keys, duplicate keys and more than one document are refused, so
a graph file means what it looks like and can neither import anything nor explode.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from tactograph.graph.errors import GraphError, InputError

Path_ = tuple[str | int, ...]
MAX_BYTES = 1_000_000
MAX_DEPTH = 20
_PLAIN_TAGS = {f"tag:yaml.org,2002:{kind}" for kind in ("null", "bool", "int", "float", "str")}


@dataclass(frozen=True)
class Place:
    """A place in a graph file: counted from 1, as editors do."""

    file: str
    line: int
    column: int
    path: str = ""

    def __str__(self) -> str:
        where = f"{self.file}:{self.line}:{self.column}"
        return f"{where}: {self.path}" if self.path else where


@dataclass
class Document:
    """Plain data and, for every path into it, the place it was read from."""

    data: Any
    places: dict[Path_, Place]

    def place(self, path: Path_) -> Place:
        """The place of `path`, or of its closest parent that stands in the file."""
        for length in range(len(path), -1, -1):
            if path[:length] in self.places:
                found = self.places[path[:length]]
                return Place(found.file, found.line, found.column, dotted(path))
        raise KeyError(path)


def dotted(path: Path_) -> str:
    """Write a path as ``nodes.shadow.with.threshold`` or ``patch[0].set``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def read_yaml(file: Path) -> Document:
    """Read one YAML file.

    Raises
    ------
    InputError
        If there is no such file, or it cannot be read.
    GraphError
        If it is not strict YAML, with line and column.
    """
    try:
        raw = file.read_bytes()
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror or error}") from None
    if len(raw) > MAX_BYTES:
        raise GraphError(f"{file}: {len(raw)} bytes is too large for a graph file (1 MB at most)")
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError as error:
        raise GraphError(f"{file}: not a text file (byte {error.start} is not UTF-8)") from None
    return parse_yaml(text, str(file))


def parse_yaml(text: str, name: str) -> Document:
    """Parse YAML text; `name` stands for the file in messages."""
    yaml = YAML(typ="safe", pure=True)
    try:
        root = yaml.compose(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"{name}:{mark.line + 1}:{mark.column + 1}" if mark else name
        problem = (error.problem or "").partition("\n")[0]
        raise GraphError(f"{place}: not YAML: {problem or error.context}") from None
    except YAMLError as error:
        first = str(error).partition("\n")[0]
        raise GraphError(f"{name}: not YAML: {first}") from None
    except RecursionError:
        raise GraphError(f"{name}: nested too deeply for a graph file") from None
    if root is None:
        raise GraphError(f"{name}: the file is empty; a graph file starts with 'format: 1'")
    places: dict[Path_, Place] = {}
    return Document(_plain(root, (), name, places, set()), places)


def parse_scalar(text: str) -> Any:
    """Read a value typed on the command line by the same rules as in a graph file."""
    resolver = YAML(typ="safe", pure=True).resolver
    tag = str(resolver.resolve(ScalarNode, text, (True, False)))
    return _scalar(text, tag)


def _plain(node: Node, path: Path_, name: str, places: dict[Path_, Place], seen: set[int]) -> Any:
    mark = node.start_mark
    place = Place(name, mark.line + 1, mark.column + 1, dotted(path))
    places[path] = place
    if id(node) in seen or node.anchor is not None:
        raise GraphError(f"{place}: anchors and aliases are not allowed; use 'extends' to share")
    seen.add(id(node))
    if len(path) > MAX_DEPTH:
        raise GraphError(f"{place}: nested too deeply for a graph file")
    if isinstance(node, ScalarNode):
        tag = str(node.tag)
        if tag not in _PLAIN_TAGS:
            raise GraphError(f"{place}: the tag '{tag}' is not allowed; write plain YAML")
        return _scalar(node.value, tag)
    if isinstance(node, SequenceNode):
        return [_plain(v, (*path, i), name, places, seen) for i, v in enumerate(node.value)]
    assert isinstance(node, MappingNode)
    return _mapping(node, path, name, places, seen)


def _mapping(
    node: MappingNode, path: Path_, name: str, places: dict[Path_, Place], seen: set[int]
) -> dict[str, Any]:
    data: dict[str, Any] = {}
    for key_node, value_node in node.value:
        mark = key_node.start_mark
        where = f"{name}:{mark.line + 1}:{mark.column + 1}"
        if not isinstance(key_node, ScalarNode) or key_node.tag == "tag:yaml.org,2002:merge":
            raise GraphError(f"{where}: keys must be plain words")
        key = str(key_node.value)
        if key in data:
            raise GraphError(f"{where}: {dotted((*path, key))}: the key stands twice")
        data[key] = _plain(value_node, (*path, key), name, places, seen)
        places[(*path, key)] = Place(name, mark.line + 1, mark.column + 1, dotted((*path, key)))
    return data


def _scalar(text: str, tag: str) -> Any:
    kind = tag.rpartition(":")[2]
    if kind == "null":
        return None
    if kind == "bool":
        return text.lower() == "true"
    if kind == "int":
        return int(text.replace("_", ""), 0) if text.lstrip("+-")[:2] in ("0x", "0o") else int(text)
    if kind == "float":
        return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
    return text
