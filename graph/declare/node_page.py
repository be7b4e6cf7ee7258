"""What a node's docstring says of its ports and parameters, and all of that as a page."""

from __future__ import annotations

import inspect
import re
import types
import typing
from dataclasses import dataclass

import annotated_types
import docstring_parser

from tactograph.graph.declare.node import Node, Parameter
from tactograph.graph.declare.ports import PortType

_RETURNS = re.compile(r"^Returns\n-+\n(.*?)(?=\n\n[A-Z]\w*\n-+\n|\Z)", re.DOTALL | re.MULTILINE)
"""The whole section: to the parser every line that is not indented is a value of its own."""


@dataclass(frozen=True)
class Description:
    """A docstring (NumPy style), taken apart."""

    summary: str
    text: str
    arguments: dict[str, str]
    returns: str
    raises: list[tuple[str, str]]


def describe(node: Node) -> Description:
    """Read a node's docstring; an argument that is not described has an empty string."""
    parsed = docstring_parser.parse(node.doc, docstring_parser.DocstringStyle.NUMPYDOC)
    said: dict[str, str] = {}
    for each in parsed.params:
        for name in each.arg_name.split(","):
            said[name.strip()] = _one_line(each.description)
    known = [*node.input_names, *node.parameters]
    returns = _RETURNS.search(inspect.cleandoc(node.doc or ""))
    return Description(
        summary=_one_line(parsed.short_description),
        text=parsed.long_description or "",
        arguments={name: said.get(name, "") for name in known},
        returns=_one_line(returns[1]) if returns else "",
        raises=[(each.type_name or "", _one_line(each.description)) for each in parsed.raises],
    )


def node_page(node: Node) -> str:
    """Everything about a node, as Markdown: what flows in and out, what can be set."""
    about = describe(node)
    lines = [f"# {node.name}", "", about.summary, ""]
    if about.text:
        lines += [about.text, ""]
    lines += ["## Inputs", ""]
    lines += [_input(name, node, about) for name in node.input_names] or ["None: it is a source."]
    lines += ["", "## Parameters", ""]
    lines += [_setting(p, about) for p in node.parameters.values()] or ["None."]
    lines += ["", "## Outputs", ""]
    lines += [_output(name, port) for name, port in node.outputs.items()]
    lines += [] if node.outputs else ["None: it is a sink."]
    lines += ["", about.returns] if about.returns else []
    if about.raises:
        lines += ["", "## Errors", "", *(f"- `{name}`: {what}" for name, what in about.raises)]
    return "\n".join([*lines, "", *_facts(node), ""])


def range_of(parameter: Parameter) -> str:
    """The values that a parameter may have, in words: ``0 to 1``, ``above 0``, ``one of a, b``."""
    annotation = parameter.annotation
    marks: list[object] = []
    while typing.get_origin(annotation) is typing.Annotated:
        annotation, *more = typing.get_args(annotation)
        marks += more
    choices = [c for each in _members(annotation) for c in _choices(each)]
    if choices:
        return f"one of {', '.join(map(str, choices))}"
    rules = [
        rule
        for mark in marks
        for rule in (mark if isinstance(mark, annotated_types.GroupedMetadata) else (mark,))
    ]
    low = next((f"{r.ge:g}" for r in rules if isinstance(r, annotated_types.Ge)), "")
    above = next((f"{r.gt:g}" for r in rules if isinstance(r, annotated_types.Gt)), "")
    high = next((f"{r.le:g}" for r in rules if isinstance(r, annotated_types.Le)), "")
    below = next((f"{r.lt:g}" for r in rules if isinstance(r, annotated_types.Lt)), "")
    if low and high:
        return f"{low} to {high}"
    words = (("at least", low), ("above", above), ("at most", high), ("below", below))
    return " and ".join(f"{word} {limit}" for word, limit in words if limit)


def _input(name: str, node: Node, about: Description) -> str:
    record = node.input_records.get(name)
    kind = f"all outputs of a node that gives a {record.__name__}" if record else ""
    optional = ", may be left out" if name in node.optional_inputs else ""
    meaning = "" if record else node.inputs[name].meaning
    return _item(name, f"{kind or node.inputs[name]}{optional}", about.arguments[name] or meaning)


def _setting(parameter: Parameter, about: Description) -> str:
    default = "needed" if parameter.required else f"default {parameter.default!r}"
    facts = ", ".join(filter(None, (default, range_of(parameter))))
    return _item(parameter.name, facts, about.arguments[parameter.name])


def _output(name: str, port: PortType) -> str:
    return _item(name, f"{port}{', may be absent' if port.optional else ''}", port.meaning)


def _item(name: str, facts: str, words: str) -> str:
    return f"- `{name}` ({facts}){': ' if words else ''}{words}"


def _facts(node: Node) -> list[str]:
    kernel = f"OpenCL kernel `{node.name}.cl`" if node.has_kernel else "no OpenCL kernel"
    facts = [f"Of the package {node.package}; {kernel}."]
    if node.neutral is not None:
        what = f"`{node.neutral}` is passed on" if isinstance(node.neutral, str) else node.neutral
        facts.append(f"Taken out (`neutral`): {what}.")
    facts += [f"{symbol}: {limit.why}." for symbol, limit in node.sizes.items()]
    return facts


def _members(annotation: object) -> tuple[object, ...]:
    return typing.get_args(annotation) if _is_union(annotation) else (annotation,)


def _is_union(annotation: object) -> bool:
    return typing.get_origin(annotation) in (typing.Union, types.UnionType)


def _choices(annotation: object) -> tuple[object, ...]:
    return typing.get_args(annotation) if typing.get_origin(annotation) is typing.Literal else ()


def _one_line(text: str | None) -> str:
    return re.sub(r"\s+", " ", text or "").strip()
