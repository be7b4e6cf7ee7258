"""Check a node's parameters against its annotations, by pydantic."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError, create_model

from tactograph.graph.errors import GraphError, did_you_mean
from tactograph.graph.model import Entry
from tactograph.graph.node import Node


def check_settings(node: Node, settings: Mapping[str, Any], entry: Entry) -> dict[str, Any]:
    """Return the node's parameters, defaults filled in, each of its declared type.

    Raises
    ------
    GraphError
        If one is unknown, missing, of a wrong type or out of its range.
    """
    for name in settings:
        if name not in node.parameters:
            raise GraphError(
                f"{entry.where(f'with.{name}')}: node '{node.name}' has no parameter '{name}'"
                f"{did_you_mean(name, node.parameters)}"
            )
    try:
        model = settings_model(node.name, _Key(node)).model_validate(dict(settings))
    except ValidationError as error:
        first = error.errors()[0]
        name = str(first["loc"][0])
        if first["type"] == "missing":
            message = f"node '{node.name}' needs the parameter '{name}'"
        else:
            message = f"{first['msg'][0].lower()}{first['msg'][1:]}, not {first['input']!r}"
        raise GraphError(f"{entry.where(f'with.{name}')}: {message}") from None
    return {name: getattr(model, name) for name in node.parameters}


class _Key:
    """Lets a Node, which is no hashable value, key the cache by identity."""

    def __init__(self, node: Node) -> None:
        self.node = node

    def __hash__(self) -> int:
        return id(self.node)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and other.node is self.node


@cache
def settings_model(name: str, key: _Key) -> type[BaseModel]:
    """The pydantic model of a node's parameters; also the source of the JSON schema."""
    fields: dict[str, Any] = {
        p.name: (_lenient(p.annotation), ... if p.required else p.default)
        for p in key.node.parameters.values()
    }
    config = ConfigDict(extra="forbid", allow_inf_nan=False, protected_namespaces=())
    return create_model(name, __config__=config, **fields)


def model_of(node: Node) -> type[BaseModel]:
    """The parameters of `node` as a pydantic model."""
    return settings_model(node.name, _Key(node))


def _lenient(annotation: Any) -> Any:
    """Let ``160,120`` from a command line stand for a tuple; keep true and false from numbers."""
    if any(get_origin(a) is tuple for a in (annotation, *get_args(annotation))):
        return Annotated[annotation, BeforeValidator(_split_commas)]
    if any(a in (float, int) for a in (annotation, *get_args(annotation))):
        return Annotated[annotation, BeforeValidator(_refuse_bool)]
    return annotation


def _split_commas(value: Any) -> Any:
    return value.split(",") if isinstance(value, str) else value


def _refuse_bool(value: Any) -> Any:
    if isinstance(value, bool):
        raise ValueError("a number is needed")
    return value
