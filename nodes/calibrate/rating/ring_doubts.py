"""Collect the doubts that rings have about a calibration."""

from tactograph.graph import node
from tactograph.graph.errors import collect_warnings
from tactograph.graph.rings import brought
from tactograph.nodes import Film, Metrics
from tactograph.nodes.calibrate.film.fit_film import FilmEvidence


@node
def ring_doubts(evidence: FilmEvidence, film: Film, fitted: Metrics) -> list[str]:
    """Return the doubts of all judges that rings bring (``judges/NAME.py``), sorted by name.

    Parameters
    ----------
    evidence, film, fitted : the inputs of `fit_film`, its film and its figures
    """
    judges = [judge.load() for _, judge in sorted(brought("judges").items())]
    # What a judge only tries, such as another shape of the film, is no finding.
    with collect_warnings([]):
        return [doubt for judge in judges for doubt in judge.doubts(evidence, film, fitted)]
