"""Error of the height's zero where no film is left at rest."""

from __future__ import annotations

from tactograph.graph import node
from tactograph.nodes import ZeroError
from tactograph.nodes.trust._rest_check import MIN_CALM
from tactograph.nodes.trust._rest_evidence import FilmEvidence, FilmFigures


@node(former=dict.fromkeys(("light", "height", "drift"), "give touch_evidence's 'film'"))
def zero_error(film: FilmEvidence) -> ZeroError:
    """Return the standard deviation of the height's zero, the same for all pixels.

    Heights are above the film at rest.  A touch that reaches all borders leaves none of it, so
    that zero and tilt are guesses, as far off as the touch is high.

    Parameters
    ----------
    film
        What `touch_evidence` found.

    Returns
    -------
    float
        In mm: the height's range where less than a fifth of the image is at rest, else 0.
    """
    found = FilmFigures(*map(float, film))
    return 0.0 if found.calm >= MIN_CALM else found.highest - found.lowest
