"""What nodes warn of, as warnings of Python, which a script or a notebook shows."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable

NUMBER_PATTERN = re.compile(r"(?<!LED )\b\d[\d.]*")
"""What differs between warnings of one kind; the number of an LED tells kinds apart."""


def raise_warnings(lines: Iterable[str], raised: set[str]) -> None:
    """Raise each kind of warning that is not among those `raised`, at the caller's caller.

    In a loop over a camera's frames the figures differ from frame to frame, so they do not count.
    """
    for line in lines:
        kind = NUMBER_PATTERN.sub("", line)
        if kind not in raised:
            raised.add(kind)
            warnings.warn(line, stacklevel=3)
