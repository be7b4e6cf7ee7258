"""Join the figures of a touch."""

from tactograph.graph import InputError, node
from tactograph.nodes import Metrics


@node
def join_metrics(*metrics: Metrics) -> Metrics:
    """Return the figures of several evaluations together, in the order of the inputs.

    Parameters
    ----------
    *metrics : named figures

    Raises
    ------
    InputError
        If two inputs have a figure of the same name.
    """
    joined: Metrics = {}
    for each in metrics:
        twice = sorted(joined.keys() & each.keys())
        if twice:
            raise InputError(f"two inputs have a figure called '{twice[0]}'; leave out one of them")
        joined |= each
    return joined
