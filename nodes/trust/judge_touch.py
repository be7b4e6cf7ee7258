"""One verdict on a touch, from all that can be checked without knowing the truth.

Long because each check says in words what may be wrong and what to look at.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval

from tactograph.graph import InputError, Port, node, warn
from tactograph.nodes import (
    F4,
    CoarseLight,
    Labels,
    Light,
    LightPositions,
    Metrics,
    Misfit,
    PixelSize,
    Slope,
    Uneven,
)
from tactograph.nodes.light.film_drift import Drift
from tactograph.nodes.optics.near_light import expected_light, light_vectors
from tactograph.nodes.trust._check import Check
from tactograph.nodes.trust._curl_check import check_curl
from tactograph.nodes.trust._light_check import Touched, check_light, squared_bend
from tactograph.nodes.trust._rest_check import check_rest
from tactograph.nodes.trust._rims import MAX_RIM_SHARE, rim_share
from tactograph.nodes.trust.light_departure import Departure, light_error

TRUST_POWER = 4
"""Power of the joint figure in the trust: 0.94 at half its limit, 0.5 at it, 0.06 at twice."""
JOINT_POWER = 8
"""Power with which figures add up: checks that are all near their limits say more than one."""
MAX_CELLS = 2500
"""More cells tell no more of medians; of larger images every n-th is looked at."""


class FilmErrors(NamedTuple):
    """The LEDs, and the film's departure from its model."""

    lights: LightPositions | None = None
    misfit: Misfit | None = None
    uneven: Uneven | None = None


@node(former=dict.fromkeys(("lights", "misfit", "uneven"), "give the calibration as 'film'"))
def judge_touch(
    curl: Annotated[F4, Port("R C", "1", low=-1, high=25)],
    light: CoarseLight,
    height: Annotated[F4, Port("r c", "mm", low=-1, high=5)],
    drift: Drift | None = None,
    departure: Departure | None = None,
    slope: Slope | None = None,
    used: Labels | None = None,
    matt: Light | None = None,
    shadow: Labels | None = None,
    film: FilmErrors | None = None,
    pixel: PixelSize | None = None,
    flat: CoarseLight | None = None,
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
    curl
        R x C, as `slope_curl` gives it.
    light
        K x h x w on cells, relative to the flat frame, before any drift is taken out.
    height
        r x c in mm.
    drift
        K x 6, as `film_drift` found it.
    departure, slope, used
        H x W, 2 x H x W and H x W: the light's departure (`light_departure`), and the slopes and
        the LEDs that it tests.  Without a departure the light is not checked.
    matt, shadow
        K x H x W and H x W: the light as of a matt film, and the LEDs that do not light a pixel.
    film
        The calibration: the LEDs, K x 3 in mm, its misfit, and the standard deviation of the
        film's brightness; without that it is known.
    pixel
        mm per pixel of `slope`; with it, and with `matt`, `used`, `film` and a height of the
        slope's size, the brightness of the touched film is checked.
    flat
        K x h x w, the film at rest on the same cells as `light`; with it, light that was added
        to the touch alone is looked for.
    least
        Trust below which there is a warning.
    rim_height
        Error of the height beside rims in shadow, as a share of the greatest height.
    force
        Go on where all checks fail.
    filled
        Whether an object fills the frame: then no film at rest is looked for.
    rims_measured
        Whether the height at rims comes from their shadows, too: then rims are no warning.

    Returns
    -------
    dict
        ``trust``, 0 to 1, and the figures ``check_light``, ``check_curl`` and ``check_rest``;
        with slopes and shadows of the height's size ``rim_share``, the share of the touched
        film whose height hangs on rims that light does not measure.

    Raises
    ------
    InputError
        If all checks that are made fail, unless `force`.
    """
    lights, misfit, uneven = film or FilmErrors()
    checks = {"curl": check_curl(_thinned(curl))}
    if not filled:
        rest = None if flat is None else _thinned(flat)
        checks["rest"] = check_rest(_thinned(light), drift, height, lights, rest)
    if departure is not None and slope is not None:
        tall = 0.0 if lights is None else float(np.abs(height).max() / _nearest(lights))
        error = light_error(misfit, uneven or 0.0)
        labels = (None if plane is None else _thinned(plane) for plane in (used, matt, shadow))
        touched = Touched(_thinned(departure), _thinned(slope), *labels)
        touched = touched._replace(bend=_thinned(squared_bend(slope)))
        if lights is not None and pixel is not None and height.shape == slope.shape[1:]:
            vectors = light_vectors(lights, _thinned(height), pixel * _step(height))
            touched = touched._replace(shown=expected_light(vectors, touched.slope))
        brightness_error = float(np.hypot(light_error(misfit, 0.0), uneven or 0.0))
        rim_error = rim_height * tall / error
        checks["light"] = check_light(touched, len(light), rim_error, brightness_error, error)
    joint = sum(check.figure**JOINT_POWER for check in checks.values()) ** (1 / JOINT_POWER)
    trust = 1 / (1 + joint**TRUST_POWER)
    if all(check.figure > 1 for check in checks.values()) and not force:
        raise InputError(f"{_causes(checks)}: no height follows; force=true goes on all the same")
    if trust < least:
        warn(f"{_causes(checks)}; the height may be wrong")
    figures = {"trust": trust} | {f"check_{n}": check.figure for n, check in checks.items()}
    if slope is not None and shadow is not None and shadow.shape == height.shape:
        figures["rim_share"] = share = rim_share(height, slope, shadow)
        if share > MAX_RIM_SHARE and not rims_measured:
            warn(
                f"{share:.0%} of the touch hangs on rims that light does not measure: steeper "
                "than a cell shows, or in the shadow of several LEDs. It may stand higher "
                "(precise measures rims by their shadows)"
            )
    return figures


def _causes(checks: dict[str, Check]) -> str:
    """Reasons of the failed checks, the worst first."""
    worst_first = sorted(checks.values(), key=lambda check: -check.figure)
    failed = [check.cause for check in worst_first if check.figure > 1]
    return ", and ".join(failed or [worst_first[0].cause])


def _nearest(lights: LightPositions) -> float:
    """The distance of the nearest LED from the middle of the film, in mm."""
    return float(np.sqrt((lights * lights).sum(axis=1)).min())


def _step(planes: Any) -> int:
    """The n of every n-th row and column of images that have more than `MAX_CELLS` pixels."""
    return max(1, round(float(np.sqrt(planes.shape[-2] * planes.shape[-1] / MAX_CELLS))))


def _thinned(planes: Any) -> Any:
    step = _step(planes)
    return planes[..., ::step, ::step]
