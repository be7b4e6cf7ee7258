"""Name a film that is no plane at rest, where it was calibrated as one."""

import math

import numpy as np

from tactograph.rings.curved_film.nodes.find_rest import BALL_BENDS, MIN_PRESSES, Bending
from tactograph.sdk import Film, FilmEvidence, Judged


def doubts(evidence: FilmEvidence, film: Film, fitted: dict[str, float]) -> list[str]:
    """Return a doubt if one bend over the frame explains the light better than a plane.

    It is looked for only where something is wrong: LEDs at infinity, or normals of held-out presses
    that are far off, by the film that was found or by a larger model that errs more than a plain
    film.

    Parameters
    ----------
    evidence, film, fitted : the inputs of `fit_film`, its film and its figures
    """
    plain_deg = fitted.get("film_heldout_deg/matt", math.inf)
    errors = {n: deg for n, deg in fitted.items() if n.startswith("film_heldout_deg")}
    worse = (deg for n, deg in errors.items() if n == "film_heldout_deg" or deg > plain_deg)
    heldout = Judged.of_heldout("film_heldout_deg", max(worse, default=None))
    presses = np.count_nonzero(evidence.circle[:, 2])
    if (
        evidence.shape is not None
        or not (evidence.is_parallel(film) or heldout.doubts)
        or not MIN_PRESSES <= presses == len(evidence.selection)
    ):
        return []
    unknown = np.full((presses, 3), np.nan, np.float32)
    bending = Bending(evidence, unknown, film.camera, BALL_BENDS)
    bend = bending.found()
    odds = bend.fit.odds(bending.fit(np.zeros(5)), further=1)
    if not odds.are_sure:
        return []
    radius = 1 / float(bend.unknowns[0])
    return [
        f"the film is no plane at rest: a bend with a radius of {radius:.3g} mm explains the light "
        f"better by odds of 10^{odds.logarithm / math.log(10):.0f}: give its shape at rest, by a "
        "file or its radius, to calibrate_curved"
    ]
