"""Check lamps of known places against the light of the untouched film."""

from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from tactograph.sdk import (
    F8,
    Film,
    FilmEvidence,
    InputError,
    Light,
    LightPositions,
    PixelSize,
    node,
    warn,
)

DIRECTION_DEVIATION = 0.01
"""Standard deviation of a lamp's direction in radians, and of its distance as a share of it."""
MAX_MISFIT = 0.02
"""Departure of the film's light from that of the lamps, above which other orders are tried."""
MAX_MISFIT_RATIO = 0.5
"""Misfit of another order, over that of the given one, below which the given one is wrong."""


class LampLights(NamedTuple):
    """A matt film under the lamps, figures, and what speaks against the lamps."""

    film: Film
    quality: dict[str, float]
    doubts: list[str]


@node
def lamp_lights(
    lamps: LightPositions, flat: Light, pixel: PixelSize, doubts: list[str] | None = None
) -> LampLights:
    """Return a matt film under lamps of known places, once the flat frame does not contradict them.

    Near lamps light the film unevenly, each in its own way.  What all share, such as the film's
    albedo and vignetting, is left out, and so is each lamp's strength: it is found here, and the
    division by the flat frame does away with it.

    Parameters
    ----------
    lamps : K x 3 in mm, as `read_lamps` gives them
    flat : K x H x W, the film at rest
    pixel : mm per px
    doubts : those about the lamps' places

    Raises
    ------
    InputError
        If the film's light is that of the lamps in another order.
    """
    quality: dict[str, float] = {}
    doubts = [*(doubts or [])]
    evidence = FilmEvidence.of_flat(flat, pixel, lamps.astype(np.float64))
    rest = evidence.rest()
    if rest is not None:
        places = lamps.astype(np.float64)[:, :, None]
        square = (places[:, 0] - rest.x) ** 2 + (places[:, 1] - rest.y) ** 2 + places[:, 2] ** 2
        modelled, measured = _less_mean(-1.5 * np.log(square)), _less_mean(rest.logarithm)
        wrong = np.square(measured[:, None] - modelled[None]).mean(axis=-1)
        images, order = linear_sum_assignment(wrong)
        misfit, best = np.sqrt(np.diag(wrong).mean()), np.sqrt(wrong[images, order].mean())
        if misfit > MAX_MISFIT and best < MAX_MISFIT_RATIO * misfit:
            raise InputError(
                f"the film's light fits the lamps in the order {', '.join(map(str, order + 1))}: "
                "check the order of the lamps' lines, and that y points down (in an .lp up)"
            )
        quality["flat_residual_percent"] = float(100 * misfit)
        if misfit > MAX_MISFIT:
            doubts.append(
                f"the untouched film's light departs by {misfit:.1%} from that of the lamps: check "
                "their places (or the height that they come from: up to the camera is positive), "
                "the pixel size and that other light is kept out"
            )
            warn(doubts[-1])
    start = evidence.start()
    leds = start.leds[:, :3]
    # 1 / L_z of a lamp within 1 % of its distance, and ends of directions within 0.01.
    deviation = DIRECTION_DEVIATION * np.column_stack([1 + leds[:, :2] ** 2, leds[:, 2]])
    others = start.other_places(np.diag(deviation.ravel() ** 2), pixel * flat.shape[2])
    return LampLights(Film.matt(lamps)._replace(other_lights=others), quality, doubts)


def _less_mean(logarithm: F8) -> F8:
    """Each lamp's own part, K x N: without the common part, and without its strength."""
    shared = logarithm - logarithm.mean(axis=0)
    return np.asarray(shared - shared.mean(axis=1, keepdims=True))
