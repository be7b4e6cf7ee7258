"""Doubts and verdicts that both kinds of calibration share."""

from typing import NamedTuple

from tactograph.nodes import Metrics

MAX_ERROR_DEG = 3.0
"""Degrees of held-out error above which a calibration is doubtful."""


class Judged(NamedTuple):
    """Figures, and what speaks against a calibration, a sentence each."""

    quality: Metrics
    doubts: list[str]


class Advice(NamedTuple):
    """Figures for programs, and one sentence for people."""

    quality: Metrics
    advice: str


def of_heldout_error(degrees: float | None) -> list[str]:
    """Return a doubt if the normals of what was held out are far off."""
    if degrees is None or degrees <= MAX_ERROR_DEG:
        return []
    return [
        f"normals of what was held out are {degrees:.1f} degrees off, more than "
        f"{MAX_ERROR_DEG:g}: check the ball's radius, the pixel size, the order of the images and "
        "dirt on the ball"
    ]


def verdict_of(doubts: list[str], figure: str, degrees: float | None) -> str:
    """Return one sentence that leads with what counts: the first doubt, or the held-out error."""
    if doubts:
        return f"doubtful: {doubts[0]}"
    if degrees is None:
        return "nothing speaks against it"
    return (
        f"nothing speaks against it; {figure} counts: normals of what was held out are "
        f"{degrees:.2g} degrees off"
    )


def advice_after(doubts: list[str], advice: str) -> str:
    """Return advice that does not say that all is well while something is doubtful."""
    return f"settle first what is doubtful; else {advice}" if doubts else advice
