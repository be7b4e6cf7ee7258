"""The types that an annotation wraps, and the limits and choices that it states."""

import types
import typing
from typing import Annotated, Any, Literal, NamedTuple

import annotated_types

_LIMIT_TYPES = (annotated_types.Ge, annotated_types.Gt, annotated_types.Le, annotated_types.Lt)


class Limits(NamedTuple):
    """The limits of a number, None where there is none."""

    at_least: float | None
    above: float | None
    at_most: float | None
    below: float | None


def limits_of(annotation: Any) -> Limits:
    """The limits that an annotation states; it may be optional."""
    stated: dict[type, float] = {}
    for part in parts_of(annotation):
        for mark in getattr(part, "__metadata__", ()):
            for rule in mark if isinstance(mark, annotated_types.GroupedMetadata) else (mark,):
                if isinstance(rule, _LIMIT_TYPES):
                    stated[type(rule)] = float(getattr(rule, type(rule).__name__.lower()))
    return Limits(*map(stated.get, _LIMIT_TYPES))


def choices_of(annotation: Any) -> list[Any]:
    """The values that a `Literal` in an annotation lists."""
    literals = [part for part in parts_of(annotation) if typing.get_origin(part) is Literal]
    return [choice for literal in literals for choice in typing.get_args(literal)]


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
