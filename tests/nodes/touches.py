"""Touches with stated parts, for the nodes that write or show them."""

from dataclasses import fields
from typing import Any

from tactograph.nodes.stream.touch import Touch


def touch_of(**parts: Any) -> Touch:
    """A touch of these parts; those that are no field of a touch are layers."""
    known = {field.name for field in fields(Touch)}
    layers = {
        name: value for name, value in parts.items() if name not in known and value is not None
    }
    return Touch(**{name: value for name, value in parts.items() if name in known}, layers=layers)
