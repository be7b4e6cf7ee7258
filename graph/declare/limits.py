"""The type that a parameter's annotation states, and its limits."""

import types
import typing
from collections.abc import Iterator
from typing import Any, NamedTuple

import annotated_types

_LIMIT_TYPES: dict[str, type] = {
    "ge": annotated_types.Ge,
    "gt": annotated_types.Gt,
    "le": annotated_types.Le,
    "lt": annotated_types.Lt,
}


class Limits(NamedTuple):
    """The limits of a number, None where there is none."""

    at_least: float | None
    above: float | None
    at_most: float | None
    below: float | None


def limits_of(annotation: Any) -> Limits:
    """The limits that an annotation states, also where the number may be None."""
    rules = list(_rules(annotation))
    return Limits(
        *(
            next((float(getattr(rule, name)) for rule in rules if isinstance(rule, kind)), None)
            for name, kind in _LIMIT_TYPES.items()
        )
    )


def bare_type(annotation: Any) -> Any:
    """The type without its `Annotated`, and without None where it is the only other member."""
    while typing.get_origin(annotation) is typing.Annotated:
        annotation = typing.get_args(annotation)[0]
    members = [each for each in members_of(annotation) if each is not type(None)]
    return bare_type(members[0]) if len(members) == 1 and members[0] != annotation else annotation


def members_of(annotation: Any) -> tuple[Any, ...]:
    """The members of a union; of any other type itself."""
    is_union = typing.get_origin(annotation) in (typing.Union, types.UnionType)
    return typing.get_args(annotation) if is_union else (annotation,)


def choices_of(annotation: Any) -> list[Any]:
    """The values that a `Literal` among an annotation's members lists."""
    literals = [
        m for m in members_of(bare_type(annotation)) if typing.get_origin(m) is typing.Literal
    ]
    return [choice for literal in literals for choice in typing.get_args(literal)]


def _rules(annotation: Any) -> Iterator[Any]:
    if typing.get_origin(annotation) is typing.Annotated:
        annotation, *marks = typing.get_args(annotation)
        for mark in marks:
            yield from mark if isinstance(mark, annotated_types.GroupedMetadata) else (mark,)
        yield from _rules(annotation)
    for member in members_of(annotation):
        if member != annotation:
            yield from _rules(member)
