"""YAML without surprises: plain data, YAML 1.2 scalars, and the place of every value.

Directives, tags, anchors, aliases, merge keys, duplicate keys and more than one document are
refused, so a graph file means what it looks like, cannot import anything, and cannot expand.
"""

from __future__ import annotations

import json
import re
import unicodedata
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeVar

from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML, __version__ as _ruamel_version
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from tactograph.graph import errors
from tactograph.graph.disk.disk_cache import cached_file, read_cached, write_cached
from tactograph.graph.disk.yaml_errors import in_words
from tactograph.graph.errors import GraphError, InputError, did_you_mean, printable, shortened

Path_ = tuple[str | int, ...]
Entries = TypeVar("Entries", bound=BaseModel)
MAX_BYTES = 100_000
MAX_DEPTH = 20
MAX_KEPT_BYTES = 10**7
"""Largest size of parsed files on disk, enough for a thousand graphs."""
MAX_DOCUMENTS = 256
"""Parsed files in memory; with fewer than there are, reading all in turn would find none again."""
_YAML_TAG = "tag:yaml.org,2002:"
_COLLECTION_TAGS = {f"{_YAML_TAG}map", f"{_YAML_TAG}seq"}
_DIRECTIVE_LINE = re.compile(r"\ufeff?(?:[ \t]*(?:#[^\n]*)?\r?\n)*%")


class EmptyFileError(GraphError):
    """A file that holds nothing, or comments alone."""


class Place(NamedTuple):
    """A place in a graph file, counted from 1; line 0 means that it is not from a file.

    `use` is the place that uses the group around this place.
    """

    file: str
    line: int
    column: int
    path: str = ""
    use: Place | None = None

    def __str__(self) -> str:
        where = f"{self.file}:{self.line}:{self.column}" if self.line else self.file
        where = f"{where}: {self.path}" if self.path else where
        return f"{where} (used by {self.use})" if self.use else where


@dataclass
class Document:
    """Plain data, with the place in a file of every path into it."""

    data: Any
    places: dict[Path_, Place]
    root: Path_ = ()
    """Place of the data in its file."""

    @classmethod
    def read(cls, file: Path) -> Self:
        """Read one YAML file.

        Raises InputError if there is no such file, or it cannot be read; GraphError if it is not
        strict YAML, with line and column.
        """
        try:
            with file.open("rb") as opened:
                raw = opened.read(MAX_BYTES + 1)
        except OSError as error:
            raise InputError(f"{file}: cannot be read: {error.strerror or error}") from None
        if len(raw) > MAX_BYTES and b"\0" not in raw:
            raise GraphError(f"{file}: too large for a graph file ({MAX_BYTES // 1000} kB at most)")
        try:
            text = raw.decode("utf-8")
        except UnicodeDecodeError as error:
            raise GraphError(f"{file}: not a text file (byte {error.start} is not UTF-8)") from None
        return cls.parse(text, str(file), keep=True)

    @classmethod
    def parse(cls, text: str, name: str, *, keep: bool = False) -> Self:
        """Parse YAML text; `name` is the file in messages.

        With `keep` the result is kept on disk, from which the next process reads it ten times as
        fast.
        """
        parsed = (_parsed_once if keep else _parsed)(text, name)
        return cls(deepcopy(parsed.data), dict(parsed.places))

    @staticmethod
    def scalar(text: str) -> Any:
        """Read one value, as a user types it, by the rules of these files.

        Raises InputError if it looks like a number but is none.
        """
        try:
            return _scalar(text, _implicit_tag(text, plain=True))
        except ValueError:
            raise InputError(f"'{shortened(text, 40)}' is not a number") from None

    def place(self, path: Path_) -> Place:
        """The place of `path`, or of its closest parent in the file."""
        for length in range(len(path), -1, -1):
            if path[:length] in self.places:
                closest = self.places[path[:length]]
                return Place(closest.file, closest.line, closest.column, dotted(self.root + path))
        raise KeyError(path)

    def part(self, path: Path_) -> Document:
        """The part below `path`, as a document of its own."""
        data, size = self.data, len(path)
        for step in path:
            data = data[step]
        places = {p[size:]: place for p, place in self.places.items() if p[:size] == path}
        return Document(data, places, self.root + path)

    def checked(self, kind: type[Entries]) -> Entries:
        """The data as a pydantic model.  Raises InputError with the place of what is wrong."""
        try:
            return kind.model_validate(self.data)
        except ValidationError as error:
            first = error.errors()[0]
            message = first["msg"].lower()
            if first["type"] == "extra_forbidden":
                message = f"unknown key{did_you_mean(str(first['loc'][-1]), kind.model_fields)}"
            elif first["type"] == "model_type":
                message = "is no mapping; write 'name: value' lines"
            raise InputError(f"{self.place(first['loc'])}: {message}") from None


def dotted(path: Path_) -> str:
    """Write a path as ``nodes.shadow.with.threshold`` or ``patch[0].set``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


@cache
def _rules() -> tuple[object, ...]:
    """Everything besides a text that determines its meaning."""
    sources = (Path(file).read_bytes() for file in (__file__, errors.__file__))
    return *sources, _ruamel_version, unicodedata.unidata_version


@lru_cache(MAX_DOCUMENTS)
def _parsed_once(text: str, name: str) -> Document:
    """The result of `_parsed`, from disk if the same text was parsed by the same rules."""
    file = cached_file("graphs", text, *_rules())
    if file is None:
        return _parsed(text, name)
    if (cached := read_cached(file)) is None:
        document = _parsed(text, name)
        marks = [(path, place.line, place.column) for path, place in document.places.items()]
        with suppress(ValueError):  # a number with more digits than Python writes
            write_cached(file, json.dumps((document.data, marks)).encode(), MAX_KEPT_BYTES)
        return document
    data, marks = json.loads(cached)
    places = ((tuple(path), line, column) for path, line, column in marks)
    return Document(
        data, {path: Place(name, line, column, dotted(path)) for path, line, column in places}
    )


@lru_cache(MAX_DOCUMENTS)
def _parsed(text: str, name: str) -> Document:
    """Parse YAML text, cached: variants extend the same few graphs."""
    if directive := _DIRECTIVE_LINE.match(text):
        line = directive[0].count("\n") + 1
        raise GraphError(f"{name}:{line}:1: directives (%...) are not allowed; write plain YAML")
    yaml = YAML(typ="safe", pure=True)
    try:
        root = yaml.compose(text)
    except MarkedYAMLError as error:
        raise GraphError(in_words(error, name)) from None
    except YAMLError as error:
        first = str(error).partition("\n")[0]
        raise GraphError(f"{name}: not YAML: {first}") from None
    except RecursionError:
        raise GraphError(f"{name}: nested too deeply for a graph file") from None
    if root is None:
        raise EmptyFileError(f"{name}: the file is empty; a graph file starts with 'format: 1'")
    places: dict[Path_, Place] = {}
    return Document(_plain(root, (), name, places, set()), places)


def _plain(
    node: Node, path: Path_, name: str, places: dict[Path_, Place], parents: set[int]
) -> Any:
    mark = node.start_mark
    place = Place(name, mark.line + 1, mark.column + 1, dotted(path))
    places[path] = place
    _refuse_extras(node, place, parents)
    if len(path) > MAX_DEPTH:
        raise GraphError(f"{place}: nested too deeply for a graph file")
    if isinstance(node, ScalarNode):
        try:
            return _scalar(node.value, str(node.tag))
        except ValueError:
            raise GraphError(f"{place}: '{shortened(node.value, 40)}' is not a number") from None
    if isinstance(node, SequenceNode):
        return [_plain(v, (*path, i), name, places, parents) for i, v in enumerate(node.value)]
    assert isinstance(node, MappingNode)
    return _mapping(node, path, name, places, parents)


def _refuse_extras(node: Node, place: Place, parents: set[int]) -> None:
    """Refuse aliases, tags and unpaired surrogates, which plain data does not need."""
    if id(node) in parents or node.anchor is not None:
        raise GraphError(f"{place}: anchors and aliases are not allowed; use 'extends' to share")
    parents.add(id(node))
    if isinstance(node, ScalarNode):
        natural = node.tag == _implicit_tag(node.value, plain=node.style is None)
        if any("\ud800" <= character <= "\udfff" for character in node.value):
            raise GraphError(f"{place}: an unpaired surrogate is not a character")
        if printable(node.value) != node.value:
            raise GraphError(f"{place}: control characters are not allowed")
    else:
        natural = node.tag in _COLLECTION_TAGS
    if not natural:
        raise GraphError(f"{place}: the tag '{node.tag}' is not allowed; write plain YAML")


def _mapping(
    node: MappingNode, path: Path_, name: str, places: dict[Path_, Place], parents: set[int]
) -> dict[str, Any]:
    data: dict[str, Any] = {}
    for key_node, value_node in node.value:
        mark = key_node.start_mark
        where = f"{name}:{mark.line + 1}:{mark.column + 1}"
        if not isinstance(key_node, ScalarNode) or key_node.tag == f"{_YAML_TAG}merge":
            raise GraphError(f"{where}: keys must be plain words")
        key = str(key_node.value)
        place = Place(name, mark.line + 1, mark.column + 1, dotted((*path, key)))
        _refuse_extras(key_node, place, parents)
        if key in data:
            raise GraphError(f"{place}: duplicate key")
        data[key] = _plain(value_node, (*path, key), name, places, parents)
        places[(*path, key)] = place
    return data


def _implicit_tag(text: str, *, plain: bool) -> str:
    """The tag that YAML 1.2 gives to an untagged scalar; a quoted one is text."""
    return str(_YAML_RESOLVER.resolve(ScalarNode, text, (plain, not plain)))


def _scalar(text: str, tag: str) -> Any:
    kind = tag.rpartition(":")[2]
    if kind == "null":
        return None
    if kind == "bool":
        return text.lower() == "true"
    if kind == "int":
        prefixed = text.lstrip("+-")[:2] in ("0x", "0o", "0b")
        return int(text.replace("_", ""), 0) if prefixed else int(text)
    if kind == "float":
        return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
    return text  # also a date, which could be the name of a folder


_YAML_RESOLVER = YAML(typ="safe", pure=True).resolver
