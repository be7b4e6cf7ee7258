"""Touches with stated parts, for the nodes that write or show them."""

from dataclasses import fields
from typing import Any

from tactograph.nodes.stream.touch import Touch


def touch_of(**parts: Any) -> Touch:
    """A touch; parts that every touch has by their names, all others as layers."""
    known = {field.name for field in fields(Touch)}
    layers = {
        name: value for name, value in parts.items() if name not in known and value is not None
    }
    return Touch(**{name: value for name, value in parts.items() if name in known}, layers=layers)
