"""Who owns memory: what others are handed, and what the engine keeps for itself."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray


def lent(value: Any) -> Any:
    """What others are handed: arrays are read-only, of lists and mappings they get a copy."""
    if isinstance(value, dict):
        return {key: lent(each) for key, each in value.items()}
    return [lent(each) for each in value] if isinstance(value, list) else value


def own(value: Any) -> Any:
    """A copy in memory that nobody else holds."""
    if not isinstance(value, np.ndarray):
        return lent(value)
    kept = value.copy()
    kept.flags.writeable = False
    return kept


def shares(array: NDArray[Any], others: Iterable[NDArray[Any]]) -> bool:
    return any(np.may_share_memory(array, other) for other in others)
