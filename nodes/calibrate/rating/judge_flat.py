"""Detect a flat frame that does not show untouched film."""

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import node
from tactograph.nodes import F8, Light, LightPositions, PixelSize
from tactograph.nodes.calibrate.lights.light_samples import Rest
from tactograph.nodes.calibrate.rest.denoise_flat import TREND_DEGREE

MAX_SLOPE = 0.008
"""Largest RMS slope of untouched film; it is 0.002 to 0.005 on real and rendered film."""
RETAKE_FLAT = (
    "take it again with nothing touching the film, after the last touch has relaxed, and with the "
    "camera's local contrast off"
)


@node
def judge_flat(flat: Light, lights: LightPositions, pixel: PixelSize) -> list[str]:
    """Return a doubt if the flat frame shows slopes, as under a touch, or light that no film has.

    Sloping film is brighter under LEDs that it faces, and darker under the others.  The logarithm
    of the flat frame minus the mean over the LEDs, and minus polynomials, is a slope times the
    tangents of the LEDs' slants.  The residual of a fit of slopes is expressed as the slopes that
    it would give by chance.  If those are larger than the fitted slopes (an F test), the frame is
    uneven for another reason.

    Parameters
    ----------
    flat : K x H x W, the film at rest
    lights : K x 3 in mm
    pixel : mm per px
    """
    rest = Rest.of(flat, pixel)
    towards = lights[:, :2] / lights[:, 2:]
    towards = (towards - towards.mean(axis=0)).astype(np.float64)
    freedom = len(lights) - 1 - towards.shape[1]  # minus one for the mean over the LEDs
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
    """Return whether a flat frame, K x H x W, is more uneven than any LEDs and lenses make it.

    The limit is the effect of `MAX_SLOPE` on an LED at 45 degrees.
    """
    rest = Rest.of(flat, pixel)
    return rest is not None and bool(np.square(_rough_part(rest)).mean() > MAX_SLOPE**2)


def _rough_part(rest: Rest) -> F8:
    """The residual of the blocks' light after a fit of polynomials, K x M."""
    x, y = (place / np.abs(place).max() for place in (rest.x, rest.y))
    terms = [x**i * y**j for i in range(TREND_DEGREE + 1) for j in range(TREND_DEGREE + 1 - i)]
    design: NDArray[np.float64] = np.stack(terms, axis=1)
    logarithm = rest.logarithm.T
    return np.asarray((logarithm - design @ np.linalg.lstsq(design, logarithm, rcond=None)[0]).T)
