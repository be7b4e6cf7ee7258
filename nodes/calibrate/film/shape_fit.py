"""A film's model fitted to presses on a film whose shape at rest has unknowns of its own."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from tactograph.graph import NodeCall
from tactograph.nodes import F8
from tactograph.nodes.calibrate.ball.balls_on_film import MAX_INDEPENDENT_SAMPLES, Fitted
from tactograph.nodes.calibrate.film.ball_samples import FilmEvidence
from tactograph.nodes.calibrate.film.film_fit import Fitting
from tactograph.nodes.calibrate.lights.descend import DERIVATIVE_STEP
from tactograph.nodes.calibrate.rating.verdict import Odds
from tactograph.nodes.light.film_bounce import film_bounce
from tactograph.nodes.optics.rest_shape import RestShape


class ShapeStep(NamedTuple):
    """A step of a shape's V unknowns, their covariance, and whether light cannot tell the step.

    The covariance is that of least squares, and as much as the step changes when each ball is left
    out (the jackknife).  Film, LEDs and balls move with the shape.
    """

    step: F8
    covariance: F8
    is_small: bool


class ShapeFit(NamedTuple):
    """Film, LEDs and balls fitted to presses on a film of some shape at rest (`of`).

    `step` says how that shape has to change, `odds` whether this fit is likelier than another.
    """

    evidence: FilmEvidence
    fitting: Fitting
    fitted: Fitted

    @classmethod
    def of(
        cls,
        evidence: FilmEvidence,
        parts: tuple[str, ...] = (),
        before: Self | None = None,
        *,
        bounce: NodeCall = film_bounce,
    ) -> Self:
        """Fit a matt film, or one with further parts, to evidence with a shape and a flat frame.

        The fit starts from the LEDs of the evidence, or from film and LEDs of a fit `before`, on
        another shape or with fewer parts.
        """
        used = evidence.used()
        assert used.shape is not None  # a plane's is `RestShape.of` zeros
        start = used.start() if before is None else before.fitted
        film = start.film._replace(camera=used.shape.camera)
        bounces = "bounce" in parts
        balls = used.sample(film, most=None, fine=not bounces, bounce=bounce).thinned(last=True)
        rest = used.rest(bounce if bounces else None, film)
        fitting = Fitting.of(balls, rest, parts)
        start = start._replace(film=film, shifts=np.zeros((len(used.circle), 3)))
        return cls(used, fitting, fitting.fitted(start))

    def step(self, shape: Callable[[F8], RestShape], unknowns: int) -> ShapeStep:
        """Return the best step of a shape's V unknowns.

        Parameters
        ----------
        shape : the film at rest after a step; 1 is a large one
        unknowns : V
        """
        fitted, (balls, rest, *_) = self.fitted, self.fitting
        assert rest is not None  # without its light nothing ties the balls together
        light, flat = fitted.predicted(balls), fitted.rest_residual(rest)
        by_light, by_flat = [], []
        for step in DERIVATIVE_STEP * np.eye(unknowns):
            other = shape(step)
            moved = self.evidence._replace(shape=other).laid(balls)
            by_light.append((fitted.predicted(moved) - light) / DERIVATIVE_STEP)
            beneath = replace(rest, beneath=other.at(rest.x, rest.y))
            by_flat.append((fitted.rest_residual(beneath) - flat) / DERIVATIVE_STEP)
        by, by_rest = np.stack(by_light), np.stack(by_flat)
        best, spread = self.fitting.further_step(fitted, by, by_rest)
        is_small = bool((np.square(best) < np.diag(spread)).all())
        for number in np.unique(balls.ball):
            others = balls.ball != number
            without = self.fitting._replace(balls=balls.only(others))
            away = without.further_step(fitted, by[..., others], by_rest)[0] - best
            spread = spread + np.outer(away, away) * (1 - 1 / len(balls.centre))
        return ShapeStep(best, spread, is_small)

    def odds(self, other: Self, further: int = 0) -> Odds:
        """Return the odds of this fit over another's on the same presses.

        `further` is by how many unknowns its shape has more than the other's.
        """
        more = len(self.fitting.unknowns.names) - len(other.fitting.unknowns.names) + further
        values = min(self.fitting.balls.u.size, MAX_INDEPENDENT_SAMPLES)
        return Odds.of(other.fitted.scale, self.fitted.scale, more, values)
