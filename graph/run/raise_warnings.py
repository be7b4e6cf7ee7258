"""Raise warnings of nodes as Python warnings, which a script or a notebook shows."""

import re
import warnings
from collections.abc import Iterable

NUMBER_PATTERN = re.compile(r"(?<!LED )\b\d[\d.]*")
"""The numbers that may differ between warnings of one kind; an LED's number may not."""

CALLER_LEVEL = 4
"""Stack frames from here to the line that calls a pipeline, or iterates over its stream."""


def warning_kind(line: str) -> str:
    """A warning without its numbers, which differ from item to item."""
    return NUMBER_PATTERN.sub("", line)


def raise_warnings(lines: Iterable[str], raised: set[str]) -> None:
    """Raise each kind of warning that is not in `raised`, at the line that uses the pipeline."""
    for line in lines:
        kind = warning_kind(line)
        if kind not in raised:
            raised.add(kind)
            warnings.warn(line, stacklevel=CALLER_LEVEL)
