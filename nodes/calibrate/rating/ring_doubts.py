"""Collect the doubts that rings have about a calibration."""

from tactograph.graph import node
from tactograph.graph.rings import bring, brought
from tactograph.nodes import Film, Metrics
from tactograph.nodes.calibrate.film.fit_film import FilmEvidence


@node
def ring_doubts(evidence: FilmEvidence, film: Film, fitted: Metrics) -> list[str]:
    """Return the doubts of all judges that rings bring (``judges/NAME.py``), sorted by name.

    Parameters
    ----------
    evidence, film, fitted : the inputs of `fit_film`, its film and its figures
    """
    judges = [bring("judges", name) for name in sorted(brought("judges"))]
    return [doubt for judge in judges if judge for doubt in judge.doubts(evidence, film, fitted)]
