"""Doubts and verdicts that both kinds of calibration share."""

import math
from typing import NamedTuple, Self

import numpy as np
from scipy.special import ndtr, ndtri, stdtrit

from tactograph.nodes import FALSE_ALARMS, Metrics

SURE_ODDS = 1e3
"""Odds above which one explanation is preferred to another."""
MAX_INDEPENDENT_REST = 20
"""Maximum number of independent values per LED in a frame whose residual from a model is smooth."""
MAX_ERROR_DEG = 3.0
"""Degrees of held-out error above which a calibration is doubtful."""


class Judged(NamedTuple):
    """Figures, doubts about a calibration (one sentence each), and what nothing confirms."""

    quality: Metrics
    doubts: list[str]
    unconfirmed: str = ""

    @classmethod
    def of_heldout(cls, figure: str, degrees: float | None) -> Self:
        """Return a doubt if held-out normals are far off, or if none could be measured (NaN)."""
        quality = {} if degrees is None else {figure: degrees}
        if degrees is None or degrees <= MAX_ERROR_DEG:
            return cls(quality, [])
        if math.isnan(degrees):
            doubt = (
                "no press could be checked by the others, since they do not find its contact: "
                "press deeper, and check the ball's radius and the pixel size"
            )
        else:
            doubt = (
                f"held-out normals are {degrees:.1f} degrees off, more than "
                f"{MAX_ERROR_DEG:g}: check the ball's radius, the pixel size, the order of the "
                "images, dirt on the ball, and that gamma and local contrast are off"
            )
        return cls(quality, [doubt])

    @staticmethod
    def reach(count: int) -> float:
        """Return the deviations that so many normal values exceed in `FALSE_ALARMS` of the cases.

        By chance, and any of them to either side.
        """
        return float(-ndtri(FALSE_ALARMS / (2 * count)))

    def verdict(self, figure: str) -> str:
        """Return a sentence: the first doubt, else what nothing confirms, else the held-out error.

        `figure` is the name of that error.
        """
        against = [doubt for doubt in self.doubts if doubt != self.unconfirmed]
        if against:
            return f"doubtful: {against[0]}"
        if self.unconfirmed:
            return f"not confirmed: {self.unconfirmed}"
        if figure not in self.quality:
            return "nothing speaks against it"
        return (
            f"nothing speaks against it; by {figure}, held-out normals are "
            f"{self.quality[figure]:.2g} degrees off"
        )

    def advice(self, advice: str) -> str:
        """Return the advice, behind the doubts if there are any."""
        return f"settle the doubts first; else {advice}" if self.doubts else advice


class Advice(NamedTuple):
    """Figures for programs, and a sentence for people."""

    quality: Metrics
    advice: str


class Odds(NamedTuple):
    """The odds of a larger model over a smaller one, as a logarithm; infinite if not computed."""

    logarithm: float = math.inf

    @classmethod
    def of(cls, before: float, after: float, unknowns: int, values: float) -> Self:
        """Return the odds by Schwarz, "Estimating the dimension of a model", 1978.

        `before` and `after` are the residual deviations of both models on `values` independent
        values; `unknowns` is the number of additional unknowns of the larger model.
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

    def pays(self, before: list[float], after: list[float]) -> bool:
        """Return whether the larger model is likelier, and errs less on what is held out.

        Its error has to be lower by more than a standard error.  This is the rule of one standard
        error (L. Breiman et al., "Classification and regression trees", 1984), for errors by fold,
        with the same folds for both models.  Few folds estimate the standard error badly, so it is
        multiplied by the quantile of Student's distribution that corresponds to one standard
        deviation of a normal distribution.
        """
        gained = np.subtract(before, after)
        error = stdtrit(gained.size - 1, ndtr(1)) * gained.std(ddof=1) / np.sqrt(gained.size)
        return self.logarithm > 0 and bool(gained.mean() > error)
