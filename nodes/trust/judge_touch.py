"""One verdict on a touch, from all that can be checked without knowing the truth.

Long because each check says in words what may be wrong and what to look at.
"""

import math
from typing import Annotated, NamedTuple

from annotated_types import Interval

from tactograph.graph import InputError, Port, node, warn
from tactograph.nodes import LightPositions, Metrics, Misfit, Uneven
from tactograph.nodes.trust._check import Check
from tactograph.nodes.trust._curl_check import check_curl
from tactograph.nodes.trust._light_check import check_light
from tactograph.nodes.trust._line_check import check_lines
from tactograph.nodes.trust._rest_check import check_rest
from tactograph.nodes.trust.film_on_rims import RimShare
from tactograph.nodes.trust.light_departure import light_error
from tactograph.nodes.trust.line_changes import LineChanges
from tactograph.nodes.trust.touch_evidence import TouchEvidence

TRUST_POWER = 4
"""Power of the joint figure in the trust: 0.94 at half its limit, 0.5 at it, 0.06 at twice."""
REFUSED_FIGURE = 1.5
"""Figure that two checks alone must exceed to refuse a touch; three need to fail only."""
JOINT_POWER = 8
"""Power with which figures add up: checks that are all near their limits say more than one."""
MAX_RIM_SHARE = 0.25
"""Share from which on there is a warning; soft presses and a real sensor's balls stay below it."""
FORMER_MAPS = ("curl", "light", "drift", "departure", "slope", "used", "matt", "shadow", "pixel")
"""Inputs that `touch_evidence` takes now."""


class FilmErrors(NamedTuple):
    """The LEDs, and the film's departure from its model."""

    lights: LightPositions | None = None
    misfit: Misfit | None = None
    uneven: Uneven | None = None


@node(
    former=dict.fromkeys(("lights", "misfit", "uneven"), "give the calibration as 'film'")
    | dict.fromkeys(FORMER_MAPS, "give touch_evidence as 'evidence'")
    | {"flat": "give added_light as 'added'"}
    | dict.fromkeys(("height", "rims"), "give film_on_rims' share as 'rim_share'")
)
def judge_touch(
    evidence: TouchEvidence,
    film: FilmErrors | None = None,
    rim_share: RimShare | None = None,
    added: Annotated[float, Port(unit="1")] | None = None,
    lines: LineChanges | None = None,
    *,
    least: Annotated[float, Interval(ge=0, le=1)] = 0.5,
    rim_height: Annotated[float, Interval(ge=0, le=1)] = 0.1,
    force: bool = False,
    filled: bool = False,
    rims_measured: bool = False,
) -> Metrics:
    """Return how far a touch can be trusted, and warn of what contradicts it.

    Three checks need no truth: the *light* against what the slopes predict, the *curl* of the
    slopes, and the film at *rest* against the flat frame.  The figure f of each is 1 at the limit
    below which right touches of rendered and real sensors stay.  The trust is
    1 / (1 + sqrt(sum of f^8)).

    Parameters
    ----------
    evidence : what `touch_evidence` found
    film
        The calibration: the LEDs, K x 3 in mm, its misfit, and the standard deviation of the
        film's brightness; without that it is known.
    rim_share : what `film_on_rims` found
    added : what `added_light` found
    lines : what `line_changes` found; a part of the check of the light
    least : trust below which there is a warning
    rim_height : error of the height beside rims in shadow, as a share of the greatest height
    force : go on where all checks fail
    filled : whether an object fills the frame: then no film at rest is looked for
    rims_measured
        Whether the height at rims comes from their shadows, too: then rims are no warning.

    Returns
    -------
    dict
        ``trust``, 0 to 1, and the figures ``check_light``, ``check_curl`` and ``check_rest``;
        also ``rim_share``, where it is given.

    Raises
    ------
    InputError
        If all three checks fail, or clearly all that are made (`REFUSED_FIGURE`), unless `force`.
    """
    lights, misfit, uneven = film or FilmErrors()
    curl, film_at_rest, light = evidence.read()
    checks = {"curl": check_curl(curl)}
    if not filled:
        checks["rest"] = check_rest(evidence.level, film_at_rest, lights, added or 0.0)
    if light.steep >= 0:
        rim_error, brightness_error = 0.0, math.hypot(light_error(misfit, 0.0), uneven or 0.0)
        if lights is not None and light.shaded:
            tallest = max(film_at_rest.highest, -film_at_rest.lowest)
            tall = tallest / _nearest(lights)
            rim_error = rim_height * tall / light_error(misfit, uneven or 0.0)
        checks["light"] = check_light(light, rim_error, brightness_error)
    if lines is not None:
        checks["light"] = max(check_lines(lines), checks.get("light", Check(0.0)))
    joint = sum(check.figure**JOINT_POWER for check in checks.values()) ** (1 / JOINT_POWER)
    trust = 1 / (1 + joint**TRUST_POWER)
    least_refused = REFUSED_FIGURE if len(checks) < 3 else 1
    if all(check.figure > least_refused for check in checks.values()) and not force:
        raise InputError(f"{_causes(checks)}: no height follows; `force`=true goes on all the same")
    if trust < least:
        warn(f"{_causes(checks)}; the height may be wrong")
    figures = {"trust": trust} | {f"check_{n}": check.figure for n, check in checks.items()}
    if rim_share is not None:
        figures["rim_share"] = rim_share
        if rim_share > MAX_RIM_SHARE and not rims_measured:
            warn(
                f"{rim_share:.0%} of the touch hangs on rims that light does not measure: steeper "
                "than a cell shows, or in the shadow of several LEDs. It may stand higher "
                "(precise measures rims by their shadows)"
            )
    return figures


def _causes(checks: dict[str, Check]) -> str:
    """Reasons of the failed checks, the worst first."""
    worst_first = sorted(checks.values(), reverse=True)
    failed = [check for check in worst_first if check.figure > 1]
    return ", and ".join(map(str, failed or worst_first[:1]))


def _nearest(lights: LightPositions) -> float:
    """The distance of the nearest LED from the middle of the film, in mm."""
    return min(math.hypot(*led) for led in lights.tolist())
