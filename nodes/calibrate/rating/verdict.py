"""Doubts and verdicts that both kinds of calibration share."""

import math
from typing import NamedTuple, Self

import numpy as np
from scipy.special import ndtr, stdtrit

from tactograph.nodes import Metrics

SURE_ODDS = 1e3
"""Odds from which one explanation is preferred to another."""
MAX_INDEPENDENT_REST = 20
"""Most independent values per LED that a frame counts as where it departs from a model, because
its departures are smooth."""
MAX_ERROR_DEG = 3.0
"""Degrees of held-out error above which a calibration is doubtful."""


class Judged(NamedTuple):
    """Figures, what speaks against a calibration, a sentence each, and what nothing confirms."""

    quality: Metrics
    doubts: list[str]
    unconfirmed: str = ""

    @classmethod
    def of_heldout(cls, figure: str, degrees: float | None) -> Self:
        """Return a doubt if normals of what was held out are far off, or none was seen (NaN)."""
        quality = {} if degrees is None else {figure: degrees}
        if degrees is None or degrees <= MAX_ERROR_DEG:
            return cls(quality, [])
        if math.isnan(degrees):
            doubt = (
                "no press could be checked by the others, as its contact is not seen where they "
                "have it: press deeper, and check the ball's radius and the pixel size"
            )
        else:
            doubt = (
                f"normals of what was held out are {degrees:.1f} degrees off, more than "
                f"{MAX_ERROR_DEG:g}: check the ball's radius, the pixel size, the order of the "
                "images, dirt on the ball, and that gamma and local contrast are off"
            )
        return cls(quality, [doubt])

    def verdict(self, figure: str) -> str:
        """Return one sentence that leads with what counts.

        That is the first doubt, or what nothing confirms, or the held-out error, a `figure`.
        """
        against = [doubt for doubt in self.doubts if doubt != self.unconfirmed]
        if against:
            return f"doubtful: {against[0]}"
        if self.unconfirmed:
            return f"not confirmed: {self.unconfirmed}"
        if figure not in self.quality:
            return "nothing speaks against it"
        return (
            f"nothing speaks against it; {figure} counts: normals of what was held out are "
            f"{self.quality[figure]:.2g} degrees off"
        )

    def advice(self, advice: str) -> str:
        """Return advice that does not say that all is well while something is doubtful."""
        return f"settle first what is doubtful; else {advice}" if self.doubts else advice


class Advice(NamedTuple):
    """Figures for programs, and one sentence for people."""

    quality: Metrics
    advice: str


def pays(before: list[float], after: list[float], odds: float = math.inf) -> bool:
    """Return whether a larger model lowers the held-out error by more than a standard error.

    And, if `odds` are given, as a logarithm, whether it is the likelier one.

    The rule of one standard error (Breiman et al., "Classification and regression trees", 1984),
    for errors by fold, which both models share.  Few folds tell the standard error badly, so that
    it counts at the quantile of Student's distribution that is one of a normal distribution.
    """
    gained = np.subtract(before, after)
    errors = stdtrit(gained.size - 1, ndtr(1))
    return odds > 0 and bool(gained.mean() > errors * gained.std(ddof=1) / np.sqrt(gained.size))


class Odds(NamedTuple):
    """The odds of a larger model over a smaller one, as a logarithm."""

    logarithm: float

    @classmethod
    def of(cls, before: float, after: float, unknowns: int, values: float) -> Self:
        """Return them by Schwarz, "Estimating the dimension of a model", 1978.

        `before` and `after` are the deviations that both models leave of so many independent
        values, `unknowns` is how many more the larger one has.
        """
        return cls(values * math.log(before / after) - unknowns * math.log(values) / 2)

    @classmethod
    def of_frame(cls, before: float, after: float, unknowns: int, lights: int) -> Self:
        """Return them of what models leave of a frame under each of so many LEDs."""
        return cls.of(before, after, unknowns, MAX_INDEPENDENT_REST * lights)

    @property
    def are_sure(self) -> bool:
        """Whether the larger model is to be preferred: `SURE_ODDS`."""
        return self.logarithm >= math.log(SURE_ODDS)
