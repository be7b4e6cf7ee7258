"""Read a graph file: strict YAML, `extends` followed, patches applied, all errors placed."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StringConstraints,
    ValidationError,
)

from tactograph.graph.backends import PREFERRED, Backend
from tactograph.graph.errors import GraphError, InputError, did_you_mean
from tactograph.graph.files.apply_patch import apply_patch
from tactograph.graph.files.flat_graph import FORMAT, Entry, Graph, Param
from tactograph.graph.files.strict_yaml import Document, Path_, Place, dotted, read_yaml

Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]
Reference = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_]\w*(\.[A-Za-z_]\w*)?$")]
Input = Annotated[str, StringConstraints(pattern=r"^(previous\.)?[A-Za-z_]\w*(\.[A-Za-z_]\w*)?$")]
Kind = Literal["path", "number", "integer", "text", "flag", "numbers"]


_WANTED = {
    "model_type": "a mapping is needed",
    "dict_type": "a mapping is needed",
    "list_type": "a list is needed",
    "too_short": "at least one is needed",
    "string_type": "text is needed",
    "bool_type": "true or false is needed",
}


def _whole(value: Any) -> Any:
    """Keep `true` and 1.0, which equal 1 to Python, from passing for it."""
    if type(value) is not int:
        raise ValueError("a whole number is needed")
    return value


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class ParamModel(_Strict):
    """A value that the user gives on the command line."""

    kind: Kind = Field(description="What the value is.")
    help: str = Field("", description="One line for people.")
    default: Any = Field(None, description="Without it, the value must be given.")


class NodeModel(_Strict):
    """A node of the graph."""

    op: Name = Field(description="The node's name; `tactograph nodes` lists them.")
    inputs: dict[Name, Input] = Field(
        default={},
        alias="in",
        description="Input port: node or node.port it reads; previous.node.port reads the "
        "value of the item before.",
    )
    settings: dict[Name, Any] = Field(
        default={}, alias="with", description="Parameters; $name stands for a graph parameter."
    )
    backend: Backend | None = Field(None, description="Refuse to run elsewhere.")
    neutral: bool = Field(False, description="Take the node out; its neutral value stands in.")


class PatchModel(_Strict):
    """One change to the graph that is extended; exactly one verb."""

    set: Name | None = Field(None, description="Change parameters (`with`) of this node.")
    replace: Name | None = Field(None, description="Put another node in this one's place.")
    insert: Name | None = Field(None, description="Add a node, `after` a reference if given.")
    remove: Name | None = Field(None, description="Remove this node.")
    backend: Name | None = Field(None, description="Run this node on the back end `to`.")
    neutral: Name | None = Field(None, description="Let this node's neutral value stand in.")
    op: Name | None = None
    inputs: dict[Name, Input] | None = Field(None, alias="in")
    settings: dict[Name, Any] | None = Field(None, alias="with")
    after: Reference | None = Field(
        None, description="Every reader of this value reads the inserted node instead."
    )
    to: Backend | None = None


class GraphModel(_Strict):
    """A graph file, or, with `extends`, a change to another one."""

    format: Annotated[Literal[1], BeforeValidator(_whole)] = Field(
        description="The version of this file format."
    )
    title: str = ""
    extends: str | None = Field(None, description="Another graph file, or a shipped one's name.")
    params: dict[Name, ParamModel] = {}
    prefer: Annotated[list[Backend], Field(min_length=1)] | None = Field(
        None, description="Back ends in order of preference."
    )
    nodes: dict[Name, NodeModel] | None = None
    patch: list[PatchModel] | None = None
    outputs: dict[Name, Reference | None] = Field(
        {}, description="null, with `extends`: the other graph's output is not wanted."
    )


def shipped_names() -> list[str]:
    """The bare names of the pipelines that ship."""
    folder = resources.files("tactograph.pipelines")
    return sorted(f.name[:-5] for f in folder.iterdir() if f.name.endswith(".yaml"))


def graph_file(name: str, beside: Path | None = None) -> Path:
    """Resolve a path or a bare name to a graph file.

    Raises
    ------
    InputError
        If there is neither such a file nor a shipped pipeline of that name.
    """
    if name.endswith((".yaml", ".yml")) or "/" in name:
        path = Path(name)
        if beside is not None and not path.is_absolute():
            path = beside / path
        if _is_file(path):
            return path
        if path.name == name and name.removesuffix(".yaml") in shipped_names():
            return Path(str(resources.files("tactograph.pipelines") / name))
        raise InputError(f"{path}: there is no such graph file")
    if name not in shipped_names():
        hint = did_you_mean(name, shipped_names())
        there = f" (the shipped ones are: {', '.join(shipped_names())})"
        raise InputError(
            f"'{name}' is neither a graph file (.yaml) nor a pipeline that ships{hint or there}"
        )
    return Path(str(resources.files("tactograph.pipelines") / f"{name}.yaml"))


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that no file can have
        return False


def read_graph(name: str) -> Graph:
    """Read the graph file `name` (a path, or the bare name of a shipped pipeline).

    Raises
    ------
    InputError
        If the file is not there.
    GraphError
        With file, line, column, path and reason, if it is not a graph file.
    """
    return _read(graph_file(name), ())


def _read(file: Path, chain: tuple[Path, ...]) -> Graph:
    if file.resolve() in chain:
        loop = " -> ".join(p.name for p in (*chain, file))
        raise GraphError(f"{file}: 'extends' runs in a loop: {loop}")
    document = read_yaml(file)
    model = _validate(document, file)
    if model.extends is None:
        return _flat(model, document, file)
    if model.nodes is not None:
        raise GraphError(
            f"{document.place(('nodes',))}: a file that extends another has no 'nodes'; "
            "add one with '- insert: ID' under 'patch'"
        )
    try:
        parent_file = graph_file(model.extends, beside=file.parent)
    except InputError as error:
        raise GraphError(f"{document.place(('extends',))}: {error}") from None
    parent = _read(parent_file, (*chain, file.resolve()))
    merged = Graph(
        name=file.stem,
        title=model.title or parent.title,
        params={**parent.params, **_params(model, document)},
        prefer=tuple(model.prefer) if model.prefer is not None else parent.prefer,
        nodes=parent.nodes,
        outputs=_wanted({**parent.outputs, **model.outputs}),
        places={**parent.places, **_places(document, ())},
    )
    for index, change in enumerate(model.patch or []):
        places = _places(document, ("patch", index))
        stated = {name: getattr(change, name) for name in change.model_fields_set}
        merged = apply_patch(merged, stated, places)
    return merged


def _flat(model: GraphModel, document: Document, file: Path) -> Graph:
    if model.patch is not None:
        raise GraphError(f"{document.place(('patch',))}: 'patch' needs 'extends'")
    if not model.nodes:
        raise GraphError(f"{document.place(())}: nodes: a graph needs at least one node")
    return Graph(
        name=file.stem,
        title=model.title,
        params=_params(model, document),
        prefer=tuple(model.prefer if model.prefer is not None else PREFERRED),
        nodes={
            node_id: Entry(
                op=node.op,
                inputs=node.inputs,
                settings=node.settings,
                backend=node.backend,
                neutral=node.neutral,
                places=_places(document, ("nodes", node_id)),
            )
            for node_id, node in model.nodes.items()
        },
        outputs=_wanted(model.outputs),
        places=_places(document, ()),
    )


def _wanted(outputs: Mapping[str, str | None]) -> dict[str, str]:
    """The outputs without those that a variant gives as null."""
    return {name: reference for name, reference in outputs.items() if reference is not None}


def _places(document: Document, path: Path_) -> dict[str, Place]:
    """The places of everything below `path`, by dotted path relative to it."""
    size = len(path)
    return {dotted(p[size:]): place for p, place in document.places.items() if p[:size] == path}


def _params(model: GraphModel, document: Document) -> dict[str, Param]:
    given = document.data.get("params") or {}
    return {
        name: Param(param.kind, param.help, "default" not in given[name], param.default)
        for name, param in model.params.items()
    }


def _validate(document: Document, file: Path) -> GraphModel:
    if not isinstance(document.data, dict):
        raise GraphError(f"{document.place(())}: a graph file is a mapping with 'format: 1'")
    try:
        return GraphModel.model_validate(document.data)
    except ValidationError as error:
        raise GraphError(_first_error(error, document)) from None


def _first_error(error: ValidationError, document: Document) -> str:
    first = error.errors()[0]
    kind = first["type"]
    path: Path_ = first["loc"]
    if path[-1] == "[key]" and kind != "extra_forbidden":
        path = path[:-1]
    place = document.place(path)
    if kind == "extra_forbidden":
        known = _known_keys(path)
        return f"{place}: unknown key '{path[-1]}'{did_you_mean(str(path[-1]), known)}"
    if kind == "missing":
        return f"{place}: '{path[-1]}' is missing"
    value = first.get("input")
    if kind == "string_pattern_mismatch":
        return f"{place}: {_short(value)} is not a name such as 'cal' or 'cal.flat'"
    if path == ("format",):
        return f"{place}: this version reads format {FORMAT}, not {_short(value)}"
    wanted = _WANTED.get(kind)
    if wanted is None and kind == "literal_error":
        wanted = f"{first['ctx']['expected']} is needed"
    return f"{place}: {wanted or first['msg'].lower()}, not {_short(value)}"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _known_keys(path: Path_) -> list[str]:
    model: type[BaseModel] = GraphModel
    if path[0] == "nodes" and len(path) > 1:
        model = NodeModel
    elif path[0] == "patch":
        model = PatchModel
    elif path[0] == "params" and len(path) > 1:
        model = ParamModel
    return [field.alias or name for name, field in model.model_fields.items()]
