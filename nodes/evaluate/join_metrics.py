"""All figures of a touch in one place."""

from __future__ import annotations

from tactograph.graph import InputError, node
from tactograph.nodes import Metrics


@node
def join_metrics(
    first: Metrics,
    second: Metrics,
    third: Metrics | None = None,
    fourth: Metrics | None = None,
    fifth: Metrics | None = None,
    sixth: Metrics | None = None,
) -> Metrics:
    """Return the figures of several evaluations together, in the order of the inputs.

    Raises
    ------
    InputError
        If two of them have a figure of the same name.
    """
    joined: Metrics = {}
    for metrics in (first, second, third or {}, fourth or {}, fifth or {}, sixth or {}):
        twice = sorted(joined.keys() & metrics.keys())
        if twice:
            raise InputError(f"join_metrics: two inputs hold a figure called '{twice[0]}'")
        joined |= metrics
    return joined
