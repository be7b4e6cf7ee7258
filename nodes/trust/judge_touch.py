"""Give one verdict on a touch, from all checks that need no truth.

Long because the mistakes that explain a doubted touch are tried one by one.
"""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from annotated_types import Interval

from tactograph.graph import InputError, node, warn
from tactograph.nodes import F4, FALSE_ALARMS, CoarseLight, LightPositions, Metrics
from tactograph.nodes.trust.check_ranks import (
    CHECK_FIGURES,
    CheckRanks,
    Ranked,
    figures_of,
    of_all_checks,
    p_values,
    residual_share,
)
from tactograph.nodes.trust.film_motion import FilmMotion, change_in_words
from tactograph.nodes.trust.film_on_rims import RimShare
from tactograph.nodes.trust.image_shifts import ImageShifts
from tactograph.nodes.trust.likely_cause import likely_cause
from tactograph.nodes.trust.line_changes import LineChanges
from tactograph.nodes.trust.other_frame import other_colours
from tactograph.nodes.trust.touch_evidence import TouchEvidence

MAX_RIM_SHARE = 0.25
"""Share above which a warning is given; soft presses and a real sensor's balls stay below it."""
NOT_CHECKED = (
    "this touch is not checked, because the calibration lacks the figures of valid touches "
    "('tactograph run rank_checks calibration=FILE' adds them)"
)


@node
def judge_touch(
    evidence: TouchEvidence,
    ranks: CheckRanks | None = None,
    rim_share: RimShare | None = None,
    lines: LineChanges | None = None,
    motion: FilmMotion | None = None,
    shifts: ImageShifts | None = None,
    light: CoarseLight | None = None,
    flat: CoarseLight | None = None,
    lights: LightPositions | None = None,
    *,
    false_alarms: Annotated[float, Interval(gt=0, lt=1)] = FALSE_ALARMS,
    only_warn: bool = False,
    filled: bool = False,
    rims_measured: bool = False,
) -> Metrics:
    """Return how far a touch can be trusted, and warn of what contradicts it.

    Three checks need no truth: the *light* against the prediction of the slopes, the *curl* of the
    slopes, and the film at *rest* against the flat frame.  The trust is the share of valid touches
    of this sensor that look at least as suspicious as this one (`check_ranks`).

    Parameters
    ----------
    evidence : the figures of `touch_evidence`
    ranks : of this sensor, from the calibration
    rim_share : the share of `film_on_rims`
    lines : the result of `line_changes`, a part of the check of the light
    motion, shifts : the results of `film_motion` and `image_shifts`
    light, flat, lights
        The light relative to the film at rest, the film at rest, and the LEDs, to find out whether
        the images of a doubted touch are in another order, mirrored, and so on.  Without LEDs, as
        on one-shot sensors, only the film at rest is used.
    false_alarms : share of valid touches that may be doubted
    only_warn : whether to go on if all checks fail
    filled : whether an object fills the frame, so that there is no film at rest
    rims_measured : whether shadows measure the height of rims, so that rims give no warning

    Returns
    -------
    dict
        ``trust``, 0 to 1, and the same for each check alone, ``check_curl``, ``check_light`` and
        ``check_rest``; also ``rim_share`` if given.  Without `ranks` nothing is checked, and a
        warning says so.

    Raises
    ------
    InputError
        If all checks fail, unless `only_warn`.
    """
    at_light = evidence.read().dirty >= 0
    on_rims = rim_share is not None and rim_share > MAX_RIM_SHARE
    open_rims = on_rims and not rims_measured
    row = (Ranked.RIGID if rims_measured and on_rims else Ranked.SOFT) if at_light else Ranked.PLAIN
    quantiles = None if ranks is None else ranks[row].astype(np.float64)
    figures: Metrics = {}
    if quantiles is None or quantiles[-1, -1] < 0:
        warn(NOT_CHECKED)
    else:
        found = figures_of(evidence, lines, motion, shifts)
        p = p_values(found, quantiles[:-1])
        shares = [of_all_checks(each, quantiles) for each in p.tolist()]
        checks = ["curl", *["light"] * at_light, *["rest"] * (not filled)]
        alone, causes = _by_check(shares, checks, false_alarms)
        figures = {"trust": min(alone.values())} | {f"check_{c}": a for c, a in alone.items()}
        if causes:
            likely = ""
            if light is not None and flat is not None and lights is not None:
                likely = likely_cause(
                    light,
                    flat,
                    lights,
                    lambda residual: residual_share(quantiles, residual) >= false_alarms,
                    has_moved=any(each is not None and each.any() for each in (motion, shifts)),
                    # Walls change the light, but neither the curl nor the film at rest.
                    has_walls=open_rims and [*causes] == ["light"],
                )
            elif light is not None and flat is not None:
                likely = other_colours(light * flat, flat)
            facts = dict(zip(CHECK_FIGURES, found.tolist(), strict=True))
            doubt = likely or _sentence(causes, facts, evidence.level, motion, open_rims)
            if len(causes) == len(alone) and not only_warn:
                raise InputError(f"{doubt}: no height is computed; `only_warn`=true continues")
            warn(f"{doubt}; the height may be wrong")
    if rim_share is not None:
        figures["rim_share"] = rim_share
        if open_rims:
            warn(
                f"{rim_share:.0%} of the touch depends on rims that light does not measure: too "
                "steep for a cell, or in the shadow of several LEDs. Its true height may be larger "
                "(precise measures rims by their shadows)"
            )
    return figures


def _by_check(
    shares: Sequence[float], checks: Sequence[str], false_alarms: float
) -> tuple[dict[str, float], dict[str, str]]:
    """The least share of each check's figures, and the cause of a check whose share is too low."""
    alone, causes = dict.fromkeys(checks, 1.0), dict[str, str]()
    for share, figure in zip(shares, CHECK_FIGURES.values(), strict=True):
        if figure.check in alone:
            alone[figure.check] = min(alone[figure.check], share)
            # Specific figures come first, so a figure with several causes is named last.
            if share < false_alarms:
                causes.setdefault(figure.check, figure.cause)
    return alone, causes


def _sentence(
    causes: dict[str, str], facts: Metrics, level: F4, motion: FilmMotion | None, open_rims: bool
) -> str:
    """The causes in one sentence, filled in with the facts of this touch."""
    brighter, change = facts["brighter"], level.astype(np.float64) - 1
    apart = change - change.mean()
    one = int(np.abs(change).argmax())
    together = np.abs(apart).max() < np.abs(change.mean())
    by = change.mean() if together else change[one]
    words = {
        "rims": "; walls and rims need the graph precise" if open_rims else "",
        "bright": "brighter" if brighter > 0 else "darker",
        "excess": abs(brighter),
        "led": "all LEDs are" if together else f"LED {one + 1} is",
        "sense": f"{'brighter' if by > 0 else 'darker'} by {abs(by):.0%}",
        "apart": facts["creep"] + facts["shift"],
        "moved": "" if motion is None else change_in_words(motion),
    }
    first, *others = (cause.format(**facts | words) for cause in causes.values())
    return ". ".join([first, *(cause[0].upper() + cause[1:] for cause in others)])
