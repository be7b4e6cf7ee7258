"""The types that an annotation wraps."""

import types
import typing
from collections.abc import Iterable
from typing import Annotated, Any


def bare_type(annotation: Any) -> Any:
    """The type without `Annotated`; for ``X | None`` it is X."""
    if typing.get_origin(annotation) is Annotated:
        return bare_type(annotation.__origin__)
    members = members_of(annotation)
    return bare_type(members[0]) if len(members) == 1 and members[0] != annotation else annotation


def members_of(annotation: Any) -> list[Any]:
    """The types of a union except None; an annotation that is no union is its only member."""
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        return [each for each in typing.get_args(annotation) if each is not type(None)]
    return [annotation]


def parts_of(annotation: Any) -> list[Any]:
    """An annotation and all types that its unions and `Annotated` wrap."""
    is_marked = typing.get_origin(annotation) is Annotated
    inner = [annotation.__origin__] if is_marked else members_of(annotation)
    return [annotation, *(p for each in inner if each != annotation for p in parts_of(each))]


def members_of_tuples(parts: Iterable[Any]) -> set[Any]:
    """All types in the tuples among the parts of an annotation."""
    tuples = [part for part in parts if typing.get_origin(part) is tuple]
    return {p for part in tuples for member in typing.get_args(part) for p in parts_of(member)}
