"""Check a node's parameters against its annotations, by pydantic."""

from collections.abc import Callable, Collection, Mapping
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError, create_model

from tactograph.graph.declare.annotations import members_of_tuples, parts_of
from tactograph.graph.declare.node import Node
from tactograph.graph.disk.strict_yaml import Document
from tactograph.graph.disk.text_names import at_home
from tactograph.graph.errors import GraphError, InputError, did_you_mean, shortened

PARAM_PLACEHOLDER = object()
"""Stands for a param's value where only the plan matters, not the data."""
MIN_MAGNITUDE, MAX_MAGNITUDE = 1e-12, 1e12
"""Range of a float parameter's magnitude, whose square and inverse float32 holds; below it: 0."""


def check_settings(
    node: Node, settings: Mapping[str, Any], where: Callable[[str], str]
) -> dict[str, Any]:
    """Return all parameters of the node, each of its declared type, with defaults filled in.

    `where` maps a parameter's name to the place of its value in the graph file.  Raises GraphError
    if a parameter is unknown, missing, of a wrong type or out of range; `PARAM_PLACEHOLDER` passes.
    """
    for name in settings:
        if name not in node.parameters:
            raise GraphError(
                f"{where(name)}: node '{node.name}' has no parameter '{name}'"
                f"{did_you_mean(name, node.parameters)}"
            )
    settings = {name: _without_traces(value) for name, value in settings.items()}
    defaults = {name: p.default for name, p in node.parameters.items()}
    if not settings and not any(p.required for p in node.parameters.values()):
        return defaults  # without a model, which takes as long to build as a node to import
    try:
        model = model_of(node).model_validate(dict(settings))
    except ValidationError as error:
        wrong = [
            e for e in error.errors() if settings.get(str(e["loc"][0])) is not PARAM_PLACEHOLDER
        ]
        if wrong:
            # Where a number or a list is accepted, the error inside the list is more specific.
            text = max(wrong, key=lambda e: (len(e["loc"]), e["type"] != "float_type"))
            raise GraphError(_message(node, where, text, settings)) from None
        return {**defaults, **settings}
    checked = {name: getattr(model, name) for name in node.parameters}
    for name, value in checked.items():
        if reason := _beyond_numbers(value):
            raise GraphError(f"{where(name)}: {reason}")
    return checked


def _without_traces(value: Any) -> Any:
    """A value whose numbers below `MIN_MAGNITUDE` are 0: a right angle's cosine is no zero."""
    if type(value) in (list, tuple):
        return type(value)(map(_without_traces, value))
    return 0.0 if isinstance(value, float) and abs(value) < MIN_MAGNITUDE else value


def _beyond_numbers(value: Any) -> str:
    """Why a value is too large for float32 or a 64-bit integer; "" if it is not."""
    for part in value if isinstance(value, list | tuple) else ():
        if reason := _beyond_numbers(part):
            return reason
    if isinstance(value, float) and abs(value) > MAX_MAGNITUDE:
        return f"a number of at most {MAX_MAGNITUDE:g} is needed, not {value:g}"
    if isinstance(value, int) and abs(value) >= 2**63:
        return "the whole number is too large"
    return ""


def _message(
    node: Node, where: Callable[[str], str], first: Any, settings: Mapping[str, Any]
) -> str:
    name = str(first["loc"][0])
    if first["type"] == "missing" and len(first["loc"]) == 1:
        return f"{where(name)}: node '{node.name}' needs the parameter '{name}'"
    message = first["msg"].removeprefix("Value error, ")
    if first["type"] == "path_type":
        message = "a path is needed"
    if first["type"] in ("too_long", "too_short"):
        message = message.replace(" after validation", "").partition(", not")[0]
    value = settings.get(name)
    is_pair = isinstance(value, list) and len(value) == 2 and all(type(n) is int for n in value)
    hint = " (for a decimal number write a point, not a comma)" if is_pair else ""
    at = "".join(f"[{part}]" for part in first["loc"][1:] if isinstance(part, int))
    text = f"{message[0].lower()}{message[1:]}, not {shortened(repr(first['input']))}"
    return f"{where(name)}: {text}{at and f' at {at}'}{hint}"


@cache
def model_of(node: Node) -> type[BaseModel]:
    """The pydantic model of a node's parameters; also the source of the JSON schema."""
    fields: dict[str, Any] = {
        p.name: (_lenient(p.annotation), ... if p.required else p.default)
        for p in node.parameters.values()
    }
    config = ConfigDict(extra="forbid", allow_inf_nan=False, protected_namespaces=())
    return create_model(node.name, __config__=config, **fields)


def _lenient(annotation: Any) -> Any:
    """Accept ``160,120`` for a tuple and ``~`` for the home folder; refuse a flag for a number."""
    parts = parts_of(annotation)
    if Path in parts:
        expanded = BeforeValidator(lambda v: at_home(str(v)) if isinstance(v, str | Path) else v)
        annotation = Annotated[annotation, expanded]
    before = _validator_for(parts)
    return annotation if before is None else Annotated[annotation, BeforeValidator(before)]


def _validator_for(parts: list[Any]) -> Callable[[Any], Any] | None:
    """The check that runs before pydantic's own, if a type needs one."""
    tuples = [part for part in parts if get_origin(part) is tuple]
    if tuples:
        fixed = {len(get_args(part)) for part in tuples if Ellipsis not in get_args(part)}
        named = [each for part in parts for each in get_args(part) if isinstance(each, str)]
        are_numbers = bool({int, float} & members_of_tuples(tuples))
        return partial(_split, are_numbers, fixed, "".join(named))
    if float in parts or (int in parts and bool not in parts):
        return _refuse_bool if {str, Path} & {*parts} else _only_number
    return _only_flag if bool in parts and not {str, int} & {*parts} else None


def _words(text: str) -> list[str]:
    """The parts of ``a,b``, which may also be written ``[a, b]``."""
    inside = text.strip()
    if inside.startswith("[") and inside.endswith("]"):
        inside = inside[1:-1]
    return [word.strip() for word in inside.split(",")] if inside.strip() else []


def _split(are_numbers: bool, lengths: Collection[int], names: str, value: Any) -> Any:
    """Split ``a,b`` into values, or check a list; refuse a length that is not in `lengths`.

    `names` are the annotation's words for the values, for the message.
    """
    if isinstance(value, str):
        value = [_scalar_of(word) if are_numbers else word for word in _words(value)]
    elif are_numbers and isinstance(value, list | tuple):
        for part in value:
            _only_number(part)
    if lengths and isinstance(value, list | tuple) and len(value) not in lengths:
        lengths_due = " or ".join(map(str, sorted(lengths)))
        raise ValueError(f"{lengths_due} values are needed{names and f' ({names})'}")
    return value


def _scalar_of(text: str) -> Any:
    """Read one part of ``a,b`` as a scalar."""
    try:
        return _without_traces(_refuse_bool(Document.scalar(text)))
    except InputError:
        return text


def _only_number(value: Any) -> Any:
    """Refuse text where a number is needed."""
    if isinstance(value, str):
        raise ValueError("a number is needed" + _comma_hint(value))
    return _refuse_bool(value)


def _comma_hint(text: str) -> str:
    """Advice on a decimal comma."""
    whole, comma, part = text.partition(",")
    is_decimal = bool(comma) and whole.lstrip("-").isdigit() and part.isdigit()
    return f", such as {whole}.{part} with a point" if is_decimal else ""


def _only_flag(value: Any) -> Any:
    if value is not None and not isinstance(value, bool):
        raise ValueError("true or false is needed")
    return value


def _refuse_bool(value: Any) -> Any:
    if isinstance(value, bool):
        raise ValueError("a number is needed")
    return value
