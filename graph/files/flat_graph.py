"""A graph as data: the content of a graph file with `extends` and `patch` applied."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tactograph.graph.declare.check_settings import PARAM_PLACEHOLDER
from tactograph.graph.declare.find_node import find_node
from tactograph.graph.disk.content_hash import digest
from tactograph.graph.disk.strict_yaml import Place
from tactograph.graph.errors import GraphError, InputError, a_few, did_you_mean, missing
from tactograph.graph.files.graph_model import GRAPH_FORMAT
from tactograph.graph.files.typed_values import MAX_NAMED_SETTINGS, overlays_with, read_value

if TYPE_CHECKING:
    from tactograph.graph.declare.node import Node
    from tactograph.graph.files.layer import Layer

CAPTURE_PARAM = "capture"
"""The param of a graph that takes a capture's folder."""
PREVIOUS_ITEM = "previous"
"""``previous.node.port`` is the value of the port at the previous item."""


@dataclass(frozen=True)
class Param:
    """A value the user gives to a graph: ``name=value`` on the command line."""

    kind: str
    help: str = ""
    required: bool = True
    default: Any = None

    @property
    def state(self) -> str:
        """Say whether the param is required."""
        if self.required:
            return "needed"
        return "optional" if self.default is None else f"default {self.default}"


@dataclass(frozen=True)
class Entry:
    """One node of a graph file."""

    op: str
    inputs: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    backend: str | None = None
    neutral: bool = False
    places: Mapping[str, Place] = field(default_factory=dict, compare=False)

    def where(self, key: str = "") -> str:
        """``file:line:column: path`` of a key such as ``with.threshold``, or of the node."""
        nearest = key
        while nearest not in self.places:
            if not nearest:
                return key
            nearest = nearest.rpartition(".")[0]
        place = self.places[nearest]
        return str(place if nearest or not key else place._replace(path=f"{place.path}.{key}"))

    @property
    def params(self) -> dict[str, str]:
        """The params of the graph that its settings take, by setting."""
        return params_in(self.settings)

    def as_dict(self) -> dict[str, Any]:
        """The keys of a file, those that say something."""
        node = {"op": self.op, "in": dict(self.inputs), "with": dict(self.settings)}
        keys = {**node, "backend": self.backend, "neutral": self.neutral}
        return {key: value for key, value in keys.items() if value}


@dataclass(frozen=True)
class Use:
    """A place where a group is used.

    As read from a file it has the stated inputs and params.  In a flat graph it has all connected
    inputs, as references of that graph, and all params.
    """

    group: str
    inputs: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    places: Mapping[str, Place] = field(default_factory=dict)
    turns: Group | None = None
    """If the group is repeated, a group of its turns, which belongs to this use alone."""

    def where(self, key: str = "") -> str:
        """``file:line:column: path`` of a key such as ``in.height``, or of the use."""
        return str(self.place(key))

    def place(self, key: str) -> Place:
        return self.places.get(key, self.places[""])


@dataclass(frozen=True)
class Graph:
    """A flat graph, which `tactograph resolve` prints and which has a hash."""

    name: str
    title: str = ""
    params: Mapping[str, Param] = field(default_factory=dict)
    prefer: tuple[str, ...] = ()
    nodes: Mapping[str, Entry] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)
    places: Mapping[str, Place] = field(default_factory=dict, compare=False)
    groups: Mapping[str, Group] = field(default_factory=dict, compare=False, repr=False)
    uses: Mapping[str, Use] = field(default_factory=dict, compare=False, repr=False)
    """The uses of groups that the nodes came from; a change may name a use or a node."""
    variants: Mapping[str, Layer] = field(default_factory=dict, compare=False, repr=False)
    """Variants in its file and in the files that it extends."""
    own: Mapping[str, Node] = field(default_factory=dict, compare=False, repr=False)
    """Nodes that a program hands over, by name; see `load`."""
    removed: Mapping[str, Place] = field(default_factory=dict, compare=False, repr=False)
    """Nodes that a change removed, with the place of the change."""
    inherited: frozenset[str] = field(default=frozenset(), compare=False, repr=False)
    """Params of the graph below the last change."""

    def where(self, key: str) -> str:
        """``file:line:column: path`` of a key such as ``outputs.height``."""
        return str(self.places.get(key, f"{self.name}: {key}"))

    def as_dict(self) -> dict[str, Any]:
        params: dict[str, Any] = {}
        for name, param in self.params.items():
            params[name] = {"kind": param.kind}
            if not param.required:
                params[name]["default"] = param.default
            if param.help:
                params[name]["help"] = param.help
        return {
            "format": GRAPH_FORMAT,
            "title": self.title,
            "params": params,
            "prefer": list(self.prefer),
            "nodes": {node_id: entry.as_dict() for node_id, entry in self.nodes.items()},
            "outputs": dict(self.outputs),
        }

    @property
    def placeholders(self) -> dict[str, Any]:
        """Placeholders for required params, for planning without data."""
        return {name: PARAM_PLACEHOLDER for name, param in self.params.items() if param.required}

    @cached_property
    def hash(self) -> str:
        """SHA-256 (first 16 digits) of the graph's nodes and settings, without its titles."""
        plain = self.as_dict()
        del plain["title"]
        for param in plain["params"].values():
            param.pop("help", None)
        return digest(plain)

    @property
    def backends(self) -> list[str]:
        """The back ends that the graph prefers, in order, then those that nodes are bound to."""
        bound = (entry.backend for entry in self.nodes.values())
        return list(dict.fromkeys([*self.prefer, *filter(None, bound)]))

    def entry(self, node_id: str) -> Entry:
        """Return the node called `node_id`, or raise an error that lists the existing ones."""
        node_id = self.in_full(node_id)
        if node_id not in self.nodes:
            raise GraphError(
                f"{self.name}: there is no node '{node_id}'{self.hint(node_id, self.nodes)}"
            )
        return self.nodes[node_id]

    @property
    def capture_param(self) -> str | None:
        """The name of the param that takes a capture's folder, if it has one."""
        return CAPTURE_PARAM if CAPTURE_PARAM in self.params else None

    def at_capture(self, folder: str | Path) -> dict[str, str]:
        """That param with the capture's folder as its value; empty if the graph has none."""
        return {} if self.capture_param is None else {self.capture_param: str(folder)}

    @staticmethod
    def captures_in(folder: Path) -> list[Path]:
        """The folder itself; if it holds folders but no file except YAML, these folders by name.

        Raises InputError if there is no such folder.
        """
        if not folder.exists():
            raise InputError(missing(folder, "folder"))
        inside = sorted(p for p in folder.iterdir() if p.name[0] != "." and p.suffix != ".yaml")
        return inside if inside and all(path.is_dir() for path in inside) else [folder]

    def read_words(self, words: Iterable[str]) -> dict[str, Any]:
        """Read ``name=value`` words, as a user types them, for its params.

        Raises InputError if a word is not of that form, names no param, or its value is of the
        wrong kind.
        """
        values: dict[str, Any] = {}
        for word in words:
            name, equals, text = word.partition("=")
            if not equals:
                first = next(iter(self.params), "name")
                example = f"{word}=VALUE" if word in self.params else f"{first}={word}"
                raise InputError(f"'{word}': write values as name=value, such as {example}")
            if name not in self.params and (settings := self.settings_called(name)):
                raise InputError(f"{self.name} has no param '{name}', but nodes have: {settings}")
            if name not in self.params and (overlays := overlays_with(param=name)):
                raise InputError(
                    f"{self.name} has no param '{name}', but overlays add it: {overlays}"
                )
            self.check_param(name)
            if name in values:
                raise InputError(f"{name} is given twice")
            param = self.params[name]
            values[name] = read_value(name, text, param.kind, required=param.required)
        return values

    def settings_called(self, name: str) -> str:
        """The parameters of that name in all nodes, as for ``--set``; "" if there is none."""
        entries = self.nodes.items()
        nodes = [n for n, entry in entries if name in find_node(entry.op, self.own).parameters]
        return a_few([f"--set {node_id}.{name}=VALUE" for node_id in nodes], MAX_NAMED_SETTINGS)

    @property
    def file(self) -> Path:
        """The file that holds it."""
        return Path(self.places[""].file)

    def check_param(self, name: str) -> None:
        """Refuse a value for a param that the graph does not have."""
        if name not in self.params:
            hint, has = did_you_mean(name, self.params), ", ".join(self.params) or "none"
            raise InputError(f"{self.name} has no parameter '{name}'{hint} (it takes: {has})")

    def check_node(self, node_id: str, where: str) -> None:
        """Refuse a reference at `where` to a node that does not exist.

        A node that a change removed is reported at the change, since its reader was right before.
        """
        if node_id in self.nodes:
            return
        if node_id in self.removed:
            raise GraphError(
                f"{self.removed[node_id]}: takes out '{node_id}', but {where} reads it; "
                "change that too, or keep the node"
            )
        raise GraphError(f"{where}: there is no node '{node_id}'{self.hint(node_id, self.nodes)}")

    def stands(self, node_id: str, where: str) -> str:
        """The place of a node in brackets, if it is in another file than `where`.

        A change in that file may have put the node before a reader that it does not suit.
        """
        place = self.nodes[node_id].places.get("")
        elsewhere = place is not None and not where.startswith(f"{place.file}:")
        return f" ('{node_id}' stands at {place})" if elsewhere else ""

    def definition(self, use: Use) -> Group:
        """The group that a use uses."""
        return use.turns or self.groups[use.group]

    def last_turn(self, path: str) -> str:
        """The last turn of a use that is repeated; any other use itself."""
        turns = self.uses[path].turns
        return f"{path}.{len(turns.body.uses)}" if turns else path

    def group_of(self, name: str) -> Group | None:
        """The group of that name, or the group of the use of that name."""
        name = self.in_full(name)
        if name in self.uses:
            return self.definition(self.uses[self.last_turn(name)])
        return self.groups.get(name)

    def uses_of(self, group: str) -> list[str]:
        """Names of all uses of a group, including those inside other uses."""
        return [path for path, use in self.uses.items() if use.group == group]

    def alike(self, node: str) -> list[str]:
        """The copies of a group's node in all uses; for a node outside groups, the node itself."""
        path, _, inner = node.rpartition(".")
        if path not in self.uses:
            return [node]
        paths = (f"{use}.{inner}" for use in self.uses_of(self.uses[path].group))
        return [path for path in paths if path in self.nodes]

    def in_full(self, name: str) -> str:
        """Expand a name by the uses around its node: ``take.cal`` for `cal`.

        An outermost node or use has precedence, then the node in the fewest uses.  A name that
        could mean several is returned unchanged.
        """
        first, dot, rest = name.partition(".")
        around = first in self.nodes or first in self.uses or first in self.groups
        if around or any(node.startswith(f"{first}.") for node in self.nodes):
            return name
        near = self._called(first)
        return f"{near[0]}{dot}{rest}" if len(near) == 1 else name

    def in_short(self, name: str) -> str:
        """The last part of a name, if that is unambiguous."""
        last = name.rpartition(".")[2]
        return last if self.in_full(last) == name else name

    def _called(self, name: str) -> list[str]:
        """The nodes and uses of that name that lie in the fewest uses."""
        removed = self.removed.keys() - self.nodes.keys() - self.uses.keys()
        paths = [path for path in self._inside.get(name, ()) if path not in removed]
        least = min((path.count(".") for path in paths), default=0)
        return [path for path in paths if path.count(".") == least]

    def hint(self, name: str, choices: Iterable[str]) -> str:
        """A suggestion for a name that no node has."""
        near = self._called(name.partition(".")[0])
        if near:
            return f"; say which: {', '.join(near)}"
        adding = overlays_with(node=name)
        return did_you_mean(name, choices) or f"; put {adding} before" * bool(adding)

    @cached_property
    def _inside(self) -> dict[str, list[str]]:
        """The nodes and uses inside uses, by the last part of their names.

        All turns have the same names, so nodes inside turns have to be named in full.
        """
        paths = [name for name in self.nodes if "." in name]
        for path, use in self.uses.items():
            body = self.definition(use).body
            paths += [f"{path}.{name}" for name in (*body.nodes, *body.uses)]
        turns = tuple(f"{path}." for path, use in self.uses.items() if use.turns)
        inside: dict[str, list[str]] = {}
        for path in dict.fromkeys(paths):
            if not path.startswith(turns):
                inside.setdefault(path.rpartition(".")[2], []).append(path)
        return inside

    def with_entry(self, node_id: str, entry: Entry) -> Graph:
        return replace(self, nodes={**self.nodes, node_id: entry})

    def with_changed(self, node_id: str, places: Mapping[str, Place], **values: Any) -> Graph:
        """Return the graph with other values of an entry, which stand at these places."""
        entry = self.nodes[node_id]
        changed = replace(entry, places={**entry.places, **places}, **values)
        return self.with_entry(node_id, changed)

    def without(self, node_ids: Iterable[str], place: Place) -> Graph:
        """Return the graph without the nodes that the change at `place` removes."""
        out = dict.fromkeys(node_ids, place)
        nodes = {n: entry for n, entry in self.nodes.items() if n not in out}
        return replace(self, nodes=nodes, removed={**self.removed, **out})


@dataclass(frozen=True)
class Group:
    """A graph inside a graph; `body` has its params, nodes, uses and outputs as written."""

    inputs: Mapping[str, Param]
    """A default is a reference of the surrounding graph, or None if the input is optional."""
    body: Graph

    @property
    def nodes(self) -> dict[str, Entry | Use]:
        """Its nodes, then its uses of other groups."""
        return {**self.body.nodes, **self.body.uses}


def params_in(settings: Mapping[str, Any]) -> dict[str, str]:
    """The params that settings take as ``$name``, by setting."""
    return {n: v[1:] for n, v in settings.items() if isinstance(v, str) and v.startswith("$")}


def split_reference(reference: str, nodes: Container[str]) -> tuple[str, str | None]:
    """Split a reference into node and port: ``pass_2.label.slope``; ``cal`` has no port."""
    node_id, _, port = reference.rpartition(".")
    return (reference, None) if reference in nodes or not node_id else (node_id, port)


def split_previous(reference: str) -> tuple[str, bool]:
    """Strip ``previous.`` from a reference, and say whether it was there."""
    bare = reference.removeprefix(f"{PREVIOUS_ITEM}.")
    return bare, bare != reference
