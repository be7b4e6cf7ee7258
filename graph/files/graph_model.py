"""Pydantic models of graph files, for checking them and for the JSON schema.

Long because it declares everything that a graph file may contain, with help for editors.
"""

from __future__ import annotations

from types import UnionType
from typing import Annotated, Any, Literal, TypeVar

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    StringConstraints,
    Tag,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    field_validator,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from tactograph.graph.backends import Backend
from tactograph.graph.disk.strict_yaml import Document, Path_
from tactograph.graph.errors import GraphError, did_you_mean, shortened

GRAPH_FORMAT = 1
Name = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]
Reference = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_]\w*(\.\w+)*$")]
Kind = Literal["path", "number", "integer", "text", "flag", "numbers"]
KIND_VALUES: dict[str, tuple[str, type[Any] | UnionType]] = {
    "path": ("a path", str),
    "number": ("a number", int | float),
    "integer": ("a whole number", int),
    "text": ("text", str),
    "flag": ("true or false", bool),
    "numbers": ("a list of numbers", list),
}
"""The values of each kind of param: in words, and their type."""
_WANTED_BY_TYPE = {
    "model_type": "a mapping is needed",
    "dict_type": "a mapping is needed",
    "list_type": "a list is needed",
    "too_short": "at least one is needed",
    "string_type": "text is needed",
    "bool_type": "true or false is needed",
}


def is_of_kind(value: Any, kind: str) -> bool:
    """Return whether a param of `kind` accepts a value."""
    if kind == "numbers":
        return isinstance(value, list) and all(is_of_kind(part, "number") for part in value)
    return isinstance(value, KIND_VALUES[kind][1]) and (kind == "flag") == isinstance(value, bool)


def _whole(value: Any) -> Any:
    """Refuse `true` and 1.0, which are equal to 1 in Python."""
    if type(value) is not int:
        raise ValueError("a whole number is needed")
    return value


Format = Annotated[
    Literal[1], BeforeValidator(_whole), Field(description="The version of this file format.")
]
_ONE_OR_MORE = (
    Field(min_length=1),
    BeforeValidator(lambda value: [value] if isinstance(value, str | int | float) else value),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}),
)
Names = Annotated[list[str], *_ONE_OR_MORE]
"""One name, or a list of them."""
References = Annotated[list[Reference], *_ONE_OR_MORE]
"""One node, or several, that a change names."""

MAX_TURNS = 100
"""Largest number of turns of a repeated group, far more than convergence takes."""


def _counted(value: Any) -> Any:
    """Turn a number into that many turns without params."""
    if type(value) is not int:
        return value
    if not 1 <= value <= MAX_TURNS:
        raise PydanticCustomError("turns", f"from 1 to {MAX_TURNS} turns are needed")
    return [{}] * value


_TURN_COUNT = {"type": "integer", "minimum": 1, "maximum": MAX_TURNS}
_TURN_PARAMS = {"type": "array", "items": {"type": "object"}, "minItems": 1}
Turns = Annotated[
    list[dict[Name, Any]],
    Field(min_length=1, max_length=MAX_TURNS),
    BeforeValidator(_counted),
    WithJsonSchema({"anyOf": [_TURN_COUNT, _TURN_PARAMS]}),
]
"""The params of each turn of a repeated group."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


def _of_its_kind(value: Any, info: ValidationInfo) -> Any:
    kind = info.data.get("kind")
    if value is not None and kind and not is_of_kind(value, kind):
        raise PydanticCustomError("kind", KIND_VALUES[kind][0] + " is needed")
    return value


class NodeModel(_Strict):
    """A node of the graph."""

    op: Name = Field(description="The node's name; `tactograph nodes` lists them.")
    inputs: dict[Name, Reference] = Field(
        default={},
        alias="in",
        description="Input port: node or node.port it reads; previous.node.port reads the "
        "value of the item before.",
    )
    settings: dict[Name, Any] = Field(
        default={},
        alias="with",
        description="Parameters; $name is a param of the graph, which `name: $name` declares.",
    )
    backend: Backend | None = Field(None, description="Refuse to run elsewhere.")
    neutral: bool = Field(False, description="Take the node out; its neutral value stands in.")


class UseModel(_Strict):
    """A use of a group: its nodes, with this one's name before theirs."""

    group: Name = Field(
        description="One of `groups`; or NAME of a file NAME.group.yaml, beside this or shipped."
    )
    inputs: dict[Name, Reference] = Field(
        default={}, alias="in", description="Input of the group: what it reads here."
    )
    settings: dict[Name, Any] = Field(
        default={}, alias="with", description="Params of the group; $name stands for one around it."
    )
    repeat: Turns | None = Field(
        None, description="Turns in sequence: their number, or the params of each."
    )
    carry: dict[Name, Reference] | None = Field(
        None, description="Input of a turn: the output of the previous turn that it reads."
    )
    while_: Reference | None = Field(
        None,
        alias="while",
        description="Output of a turn; once it is zero, later turns rest and repeat that turn.",
    )


_AN_OP, _A_GROUP = "(op)", "(group)"


def _by_key(key: str, tag: str, other: str) -> Discriminator:
    """Take the model `tag` for a mapping with this key, else the `other`."""
    return Discriminator(lambda value: tag if isinstance(value, dict) and key in value else other)


AnyNode = Annotated[
    Annotated[NodeModel, Tag(_AN_OP)] | Annotated[UseModel, Tag(_A_GROUP)],
    _by_key("group", _A_GROUP, _AN_OP),
]


class GroupInputModel(_Strict):
    """Input of a group: a value that its nodes read from outside."""

    help: str = Field("", description="One line for people.")
    default: Reference | None = Field(
        None,
        description="What it reads if a use does not state it; null: it is optional. Without a "
        "default a use has to state it.",
    )


class GroupParamModel(_Strict):
    """A value that a use gives to a group."""

    kind: Kind | None = Field(
        None, description="With a kind, the graph gets this param if a use gives no value."
    )
    help: str = Field("", description="One line for people.")
    default: Any = Field(None, description="Without it, a use or the user gives the value.")

    _of_its_kind = field_validator("default")(_of_its_kind)


class ParamModel(GroupParamModel):
    """A value that the user gives on the command line."""

    kind: Kind = Field(description="What the value is.")
    default: Any = Field(None, description="Without it, the value must be given.")


class GroupModel(_Strict):
    """Nodes that are defined once; `nodes` use them by `group`."""

    inputs: dict[Name, GroupInputModel | None] = Field(
        {}, description="What its nodes read from around it."
    )
    params: dict[Name, GroupParamModel | None] = Field(
        {}, description="Its nodes take them as $name."
    )
    nodes: Annotated[dict[Name, AnyNode], Field(min_length=1)] = Field(
        description="They read one another and the inputs."
    )
    outputs: dict[Name, Reference] = Field(
        {}, description="Names for values inside: `use.name` reads one."
    )


class GroupFileModel(GroupModel):
    """A file that holds one group."""

    format: Format


class SharedGroupModel(_Strict):
    """A group that is read from a file, with changes made here."""

    extends: str = Field(description="The file of the group.")
    params: dict[Name, GroupParamModel | None] = Field(
        {}, description="Added to those of the file, or in place of one of that name."
    )
    patch: list[PatchModel] = Field([], description="Changes to its nodes.")


_FROM_FILE, _IN_PLACE = "(extends)", "(nodes)"


_MODEL_TAGS = (_AN_OP, _A_GROUP, _FROM_FILE, _IN_PLACE)
AnyGroup = Annotated[
    Annotated[SharedGroupModel, Tag(_FROM_FILE)] | Annotated[GroupModel, Tag(_IN_PLACE)],
    _by_key("extends", _FROM_FILE, _IN_PLACE),
]


NO_VALUE: Any = None
"""The default of an absent key, for which null is no value."""


class PatchModel(_Strict):
    """One change to the extended graph, with exactly one verb.

    A name is a node, `use.node`, or `group.node`: that node in every use of the group.  A list of
    names makes the same change to each, except for `replace` and `insert`.
    """

    set: References = Field(
        NO_VALUE,
        description="Change parameters (`with`) and inputs (`in`; null: none) of this node, or "
        "parameters of a use of a group.",
    )
    replace: Reference = Field(NO_VALUE, description="Put another node in this one's place.")
    insert: Reference = Field(NO_VALUE, description="Add a node, `after` a reference if given.")
    remove: References = Field(NO_VALUE, description="Remove this node.")
    backend: References = Field(NO_VALUE, description="Run this node on the back end `to`.")
    neutral: References = Field(NO_VALUE, description="Let this node's neutral value stand in.")
    op: Name = Field(NO_VALUE)
    group: Name = Field(NO_VALUE, description="In place of `op`: use this group.")
    inputs: dict[Name, Reference | None] = Field(NO_VALUE, alias="in")
    settings: dict[Name, Any] = Field(NO_VALUE, alias="with")
    repeat: Turns = Field(NO_VALUE)
    carry: dict[Name, Reference] = Field(NO_VALUE)
    while_: Reference = Field(NO_VALUE, alias="while")
    after: Reference = Field(
        NO_VALUE, description="Every reader of this value reads the inserted node instead."
    )
    to: Backend = Field(NO_VALUE)


class ChangeModel(_Strict):
    """Keys that graph files and variants share."""

    title: str = ""
    params: dict[Name, ParamModel] = {}
    prefer: Annotated[list[Backend], Field(min_length=1)] | None = Field(
        None, description="Back ends in order of preference."
    )
    groups: dict[Name, AnyGroup] = Field(
        {}, description="Nodes that are defined once and used several times."
    )
    patch: list[PatchModel] | None = None
    outputs: dict[Name, Reference | None] = Field(
        {}, description="References by name; null, in a change, removes an output."
    )


class VariantModel(ChangeModel):
    """A named change to a graph."""

    base: str | None = Field(None, description="A graph to change instead of the file's.")
    extends: Names = Field([], description="Overlays that are laid over the graph first.")


class GraphModel(ChangeModel):
    """A graph file; with `extends`, a change to another graph; without nodes, an overlay."""

    format: Format
    extends: Names = Field(
        [],
        description="Another graph's file or name, then overlays that are laid over it in order.",
    )
    nodes: dict[Reference, AnyNode] | None = None
    variants: dict[Name, VariantModel] = Field(
        {}, description="Named changes: GRAPH_NAME is this graph with the change NAME."
    )


class StudyModel(_Strict):
    """Variants of one graph, to be compared."""

    format: Format
    title: str = ""
    base: str = Field(description="The graph that the variants change.")
    variants: Annotated[dict[Name, VariantModel], Field(min_length=1)]


Model = TypeVar("Model", bound=BaseModel)


def validate(document: Document, model: type[Model]) -> Model:
    """Check a document against its model.

    Raises GraphError with the places of everything that is not allowed in such a file.
    """
    if not isinstance(document.data, dict):
        raise GraphError(f"{document.place(())}: a graph file is a mapping with 'format: 1'")
    try:
        return model.model_validate(document.data)
    except ValidationError as error:
        errors = [_sentence(each, document, model) for each in error.errors()]
        first, *others = dict.fromkeys(errors)
        wrong = GraphError(first)
        wrong.others = others
        raise wrong from None


def _sentence(first: ErrorDetails, document: Document, whole: type[BaseModel]) -> str:
    kind = first["type"]
    model = _model_at(whole, first["loc"])
    # A tag never comes first: there it is a key of the user's own.
    start, *rest = first["loc"]
    path: Path_ = (start, *(part for part in rest if part not in _MODEL_TAGS))
    if path[-1] == "[key]" and kind != "extra_forbidden":
        path = path[:-1]
    place = document.place(path)
    if kind == "extra_forbidden":
        if model is UseModel and path[-1] in ("op", "backend", "neutral"):
            return f"{place}: a node with 'group' has no '{path[-1]}'"
        names = [field.alias or name for name, field in model.model_fields.items()]
        return f"{place}: unknown key '{path[-1]}'{did_you_mean(str(path[-1]), names)}"
    if kind == "missing":
        return f"{place}: '{path[-1]}' is missing"
    value = shortened(repr(first.get("input")))
    if kind == "string_pattern_mismatch":
        hint = "; a decimal number is written with a point" if first["input"].isdigit() else ""
        return f"{place}: {value} is not a name such as 'cal' or 'cal.flat'{hint}"
    if path == ("format",):
        return f"{place}: this version reads format {GRAPH_FORMAT}, not {value}"
    what = _WANTED_BY_TYPE.get(kind)
    if what is None and kind == "literal_error":
        what = f"{first['ctx']['expected']} is needed"
    return f"{place}: {what or first['msg'].lower()}, not {value}"


def _model_at(whole: type[BaseModel], loc: Path_) -> type[BaseModel]:
    """Return the model at the place of an error."""
    if _A_GROUP in loc[1:]:
        return UseModel
    if _AN_OP in loc[1:]:
        return NodeModel
    if loc[0] == "variants" and len(loc) > 2:
        return _model_at(VariantModel, loc[2:])
    if loc[0] == "groups" and len(loc) > 3:
        return _model_at(SharedGroupModel if loc[2] == _FROM_FILE else GroupModel, loc[3:])
    parts: dict[str | int, type[BaseModel]] = {"params": ParamModel, "patch": PatchModel}
    if issubclass(whole, GroupModel):
        parts = {"inputs": GroupInputModel, "params": GroupParamModel}
    return parts.get(loc[0], whole) if len(loc) > 1 else whole
