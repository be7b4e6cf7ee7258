"""State the error of the height's zero if no film is at rest."""

from tactograph.graph import node
from tactograph.nodes import ZeroError
from tactograph.nodes.trust.touch_evidence import TouchEvidence

MIN_CALM = 0.2
"""Share of the image at rest below which the height's zero is a guess."""


@node
def zero_error(evidence: TouchEvidence) -> ZeroError:
    """Return the standard deviation of the height's zero, the same for all pixels.

    Heights are measured from the film at rest.  A touch that reaches all borders leaves none of it,
    so zero and tilt are guesses that may be wrong by the height of the touch.

    Parameters
    ----------
    evidence : the figures of `touch_evidence`

    Returns
    -------
    In mm: the height's range where less than a fifth of the image is at rest, else 0.
    """
    film = evidence.read()
    return 0.0 if film.calm >= MIN_CALM else film.highest - film.lowest
