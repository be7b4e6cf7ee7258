"""Name a film that is no plane at rest, where it was calibrated as one."""

import math

import numpy as np

from tactograph.rings.curved_film.nodes.find_rest import (
    MIN_PRESSES,
    BallPresses,
    fitted_bend,
    tried_bends,
)
from tactograph.sdk import Film, Metrics
from tactograph.sdk.unstable import MAX_LED_WIDTHS, FilmEvidence, Judged, Odds


def doubts(evidence: FilmEvidence, film: Film, fitted: Metrics) -> list[str]:
    """Return a doubt if one bend over the frame explains the light better than a plane.

    It is looked for only where something is wrong: LEDs at infinity, or normals of held-out presses
    that are far off.  The odds are `Odds`, for as many independent samples as they count as.

    Parameters
    ----------
    evidence, film, fitted : the inputs of `fit_film`, its film and its figures
    """
    heldout = Judged.of_heldout("film_heldout_deg", fitted.get("film_heldout_deg"))
    width = evidence.pixel * evidence.flat.shape[2]
    far = float(np.linalg.norm(film.lights, axis=1).max()) > MAX_LED_WIDTHS * width
    wrong = far or bool(heldout.doubts)
    presses = np.count_nonzero(evidence.circle[:, 2])
    if (
        evidence.shape is not None
        or not wrong
        or not MIN_PRESSES <= presses == len(evidence.selection)
    ):
        return []
    known = evidence.noise, evidence.pixel, film.camera
    balls = BallPresses.of(evidence, evidence.light, evidence.flat, *known)
    bent, plane = tried_bends(balls)
    bend = fitted_bend(balls, bent, only_ball=True)
    odds = Odds.of(math.sqrt(plane.cost), math.sqrt(bend.cost), 1, bend.samples)
    if not odds.are_sure:
        return []
    radius = 1 / float(bend.unknowns[0])
    return [
        f"the film is no plane at rest: a bend with a radius of {radius:.3g} mm explains the light "
        f"better by odds of 10^{odds.logarithm / math.log(10):.0f}: give its shape at rest, by a "
        "file or its radius, to calibrate_curved"
    ]
