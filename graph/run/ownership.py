"""Ownership of memory: values that the engine lends out, and values that it keeps."""

from typing import Any

import numpy as np


def lent(value: Any) -> Any:
    """A value that others may read: arrays are read-only, lists and mappings are copied."""
    if isinstance(value, dict):
        return {key: lent(each) for key, each in value.items()}
    return [lent(each) for each in value] if isinstance(value, list) else value


def own(value: Any) -> Any:
    """A copy in memory that nobody else holds."""
    if not isinstance(value, np.ndarray):
        return lent(value)
    copy = value.copy()
    copy.flags.writeable = False
    return copy
