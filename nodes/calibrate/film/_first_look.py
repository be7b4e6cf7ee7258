"""Refuse values that the light contradicts before the long search for the film's model."""

import math
from collections.abc import Callable

from tactograph.graph import InputError
from tactograph.nodes import Film
from tactograph.nodes.calibrate.ball.balls_on_film import Balls, Fitted
from tactograph.nodes.calibrate.film.ball_samples import FilmEvidence
from tactograph.nodes.calibrate.film.film_fit import Fitting, add_harmonics
from tactograph.nodes.calibrate.film.film_unknowns import PART_UNKNOWNS
from tactograph.nodes.calibrate.film.judge_radius import (
    AS_STATED,
    MAX_SAMPLES,
    ONLY_WARN_ADVICE,
    OTHER_SIZE,
    REFUSED_ODDS,
    Alternatives,
)
from tactograph.nodes.optics.film import HARMONIC_DEGREES, term_count
from tactograph.nodes.optics.rest_shape import RestShape


def refuse_contradicted(
    evidence: FilmEvidence,
    balls: Balls,
    start: Fitted,
    parts: set[str],
    samples: Callable[[Film], Balls],
) -> None:
    """Refuse a radius if no film explains the balls as well as a plain one with another radius.

    And the shape of the film at rest, if a plain film over the same with the other sign explains
    them better.  A film has all its `parts` here, fitted to few samples, which the search hardly
    improves upon.  Light from film to film is tried last, since its `samples` take time.
    """
    shape, camera = evidence.shape, start.film.camera if evidence.shape is None else None
    least = _least(evidence, start, parts - {"bounce"}, balls)
    if shape is not None:
        other = RestShape.of(-shape.height, shape.pixel, shape.camera)
        over = evidence._replace(shape=other)
        seen = over.sample(start.film, most=None, fine=True)
        turned = Alternatives.of(over, seen, camera, names=(AS_STATED,))
        if turned.odds(AS_STATED, least) > REFUSED_ODDS:
            raise InputError(
                "the same film at rest with the other sign explains the light better, over a "
                f"billion times likelier ({turned.stated.departure:.1%} unexplained instead of "
                f"{least:.1%}): does it rise where it is stated to fall? Check its radius, drawing "
                "or file" + ONLY_WARN_ADVICE
            )
    sized = Alternatives.of(evidence, balls, camera, names=(AS_STATED, OTHER_SIZE))
    if "bounce" in parts and sized.odds(OTHER_SIZE, least) > REFUSED_ODDS:
        least = min(least, _least(evidence, start, parts, samples(start.film)))
    if sized.odds(OTHER_SIZE, least) <= REFUSED_ODDS:
        return
    every = Alternatives.of(evidence, balls, camera)
    doubts, is_clear = every.doubts(float(evidence.radius[0]), least)
    if is_clear:
        words = doubts[0].replace("`evidence.", "`").replace("`film.camera`", "`camera_mm`")
        raise InputError(words + ONLY_WARN_ADVICE)


def _least(evidence: FilmEvidence, start: Fitted, parts: set[str], balls: Balls) -> float:
    """What the best of several films leaves of balls and flat frame."""
    few, rest = balls.thinned(MAX_SAMPLES), evidence.rest()

    def departure(fitted: Fitted) -> float:
        return math.hypot(fitted.scale, 0.0 if rest is None else fitted.left_at_rest(rest))

    physical = sorted(parts & PART_UNKNOWNS.keys())
    kinds: list[list[str]] = [[], *([part] for part in physical), physical]
    tried = [Fitting.of(few, rest, kind).fitted(start) for kind in kinds]
    tried.append(Fitting.of(few, rest, physical).fitted(min(tried, key=departure)))
    degrees = [n for n in HARMONIC_DEGREES if len(few.centre) > term_count(n)]
    if "harmonics" in parts and degrees:
        tried.append(add_harmonics(few, min(tried, key=departure), degrees[-1]))
    return min(map(departure, tried))
