"""Tell a flat frame that is not one of untouched film."""

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import node
from tactograph.nodes import F8, Light, LightPositions, PixelSize
from tactograph.nodes.calibrate.lights.light_samples import Rest
from tactograph.nodes.calibrate.rest.denoise_flat import TREND_DEGREE

MAX_SLOPE = 0.008
"""Slope of untouched film, in root mean square; 0.002 to 0.005 on real and rendered film."""
RETAKE_FLAT = (
    "take it again with nothing touching the film, after the last touch has relaxed, and with the "
    "camera's local contrast off"
)


@node
def judge_flat(flat: Light, lights: LightPositions, pixel: PixelSize) -> list[str]:
    """Return a doubt if the flat frame shows slopes, as of a touch, or what no film does.

    Where film slopes, LEDs brighten it that it turns to, and others darken it.  The logarithm of
    the flat frame less the mean over the LEDs, and less polynomials, is a slope times the tangents
    of the LEDs' slants.  What slopes leave of it counts as those that it makes by chance, and is
    the cause where these are the larger ones, as the F statistic has it.

    Parameters
    ----------
    flat : K x H x W, the film at rest
    lights : K x 3 in mm
    pixel : mm per px
    """
    rest = Rest.of(flat, pixel)
    towards = lights[:, :2] / lights[:, 2:]
    towards = (towards - towards.mean(axis=0)).astype(np.float64)
    freedom = len(lights) - 1 - towards.shape[1]  # the mean over the LEDs is gone
    if rest is None or freedom < 1:
        return []
    residual, solved = _rough_part(rest), np.linalg.pinv(towards)
    slope = solved @ residual
    steepness = float(np.sqrt(np.square(slope).sum(axis=0).mean()))
    unexplained = np.square(residual - towards @ slope).sum(axis=0).mean() / freedom
    by_chance = float(np.sqrt(unexplained * np.square(solved).sum()))
    why = f"as film with slopes of {steepness:.1%} is"
    if steepness < by_chance:
        why = "unevenly, under each LED in another way"
    doubt = f"the flat frame is lit {why}, which is not at rest: {RETAKE_FLAT}"
    return [doubt] * (max(steepness, by_chance) > MAX_SLOPE)


def is_uneven(flat: Light, pixel: PixelSize) -> bool:
    """Return whether a flat frame, K x H x W, holds more than LEDs and lenses make, wherever they
    are: an LED at 45 degrees changes with the slope by as much."""
    rest = Rest.of(flat, pixel)
    return rest is not None and bool(np.square(_rough_part(rest)).mean() > MAX_SLOPE**2)


def _rough_part(rest: Rest) -> F8:
    """What polynomials leave of the blocks' light, K x M."""
    x, y = (place / np.abs(place).max() for place in (rest.x, rest.y))
    terms = [x**i * y**j for i in range(TREND_DEGREE + 1) for j in range(TREND_DEGREE + 1 - i)]
    design: NDArray[np.float64] = np.stack(terms, axis=1)
    logarithm = rest.logarithm.T
    return np.asarray((logarithm - design @ np.linalg.lstsq(design, logarithm, rcond=None)[0]).T)
