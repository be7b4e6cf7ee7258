"""Join the doubts about a calibration."""

from tactograph.graph import node


@node
def join_doubts(*doubts: list[str]) -> list[str]:
    """Return the sentences of several lists together, in the order of the inputs.

    Parameters
    ----------
    *doubts : sentences
    """
    return [sentence for each in doubts for sentence in each]
