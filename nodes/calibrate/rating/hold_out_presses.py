"""Measure each press with a calibration that has not seen it."""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import Port, node
from tactograph.nodes import (
    F4,
    Film,
    Height,
    Light,
    LightPositions,
    Metrics,
    Noise,
    PixelSize,
    Slope,
)
from tactograph.nodes.calibrate import MAX_SAMPLE_SLOPE
from tactograph.nodes.calibrate.ball.find_balls import FoundBalls
from tactograph.nodes.calibrate.lights.light_fit import LedFit, shift_of
from tactograph.nodes.calibrate.lights.light_samples import Press, Rest, presses_of, samples_for
from tactograph.nodes.calibrate.rating.pressed_ball import PressedBall
from tactograph.nodes.calibrate.tables.build_lut import in_tables
from tactograph.nodes.height.integrate_dct import integrate_dct
from tactograph.nodes.light.light_noise import light_noise
from tactograph.nodes.optics.sheet import (
    SheetHeight,
    SheetLabels,
    SheetLight,
    SheetMask,
    SheetSlope,
    cut,
)
from tactograph.nodes.shadow.label_lights import label_lights


class HeldOut(NamedTuple):
    """Errors by press, NaN where there are none, and their means."""

    degrees: Annotated[F4, Port("P", "deg", nan=True)]
    microns: Annotated[F4, Port("P", "um", nan=True)]
    quality: Metrics


@node
def hold_out_presses(
    image: SheetLight,
    light: SheetLight,
    flat: Light,
    slope: SheetSlope,
    mask: SheetMask,
    height: SheetHeight,
    lit: SheetLabels,
    balls: FoundBalls,
    noise: Noise,
    pixel: PixelSize,
    film: Film,
) -> HeldOut:
    """Place the LEDs without a press, measure the press with them, and compare it with its ball.

    The position of its ball is refined with the same LEDs.  Slopes are found as in
    `reconstruct`, at the ball's true height, and judged where at least all LEDs but one reach,
    so that the figures rate the calibration, not the treatment of shadows.  With only one
    press nothing can be held out.

    Parameters
    ----------
    image, light : K x S x W, the presses as captured and relative to the film at rest
    flat : K x H x W, the film at rest
    slope, mask, height, lit
        Of the presses, as for `calibrate_lights`; a press with an empty mask is left out.
    balls : circles B x 3 in px, radii in mm, and the press of each ball
    noise : (shot, read), from `estimate_noise`
    pixel : mm per px
    film : how its LEDs emit, and the relative standard deviation of its brightness

    Returns
    -------
    For each press, over the inner nine tenths of its contact, where all LEDs but one reach and the
    ball is not steeper than 3: the mean angle between normals in degrees, and the root mean square
    error of the height in um without its mean, because the height of the ball's rim is unknown.
    The number of ``presses`` used, and from two presses on the means ``heldout_normal_deg``,
    ``heldout_height_um`` and ``heldout_height_percent`` of the cap.
    """
    rows = flat.shape[1]
    presses = presses_of(light, slope, mask, height, lit, rows)
    used = [i for i, press in enumerate(presses) if press.mask.any()]
    degrees, microns = np.full((2, len(presses)), np.nan, np.float32)
    quality = {"presses": float(len(used))}
    if len(used) < 2:
        return HeldOut(degrees, microns, quality)
    rest, width_mm = Rest.of(flat, pixel), pixel * flat.shape[2]
    if rest is not None:
        rest = rest.under_points(film)
    most = samples_for(len(used) - 1)
    objects = {i: presses[i].samples(pixel, most) for i in used}
    everything = LedFit.of(list(objects.values()), rest, width_mm)
    percent = []
    for i in used:
        others = [other for j, other in objects.items() if j != i]
        placed = LedFit.of(others, rest, width_mm, start=everything)
        shift = shift_of(objects[i], placed)
        sigma = light_noise(cut(image, rows)[i], flat, noise)
        p, q = presses[i].slope
        reached = in_tables(presses[i].mask, presses[i].lit, len(flat))
        judged = reached & (p * p + q * q < MAX_SAMPLE_SLOPE * MAX_SAMPLE_SLOPE)
        surface = _measure(presses[i], judged, sigma, placed.lights, pixel, film.uneven, shift[2])
        errors = []
        for b in np.flatnonzero(balls.of == i):
            circle = np.array([*(balls.circle[b, :2] + shift[:2]), balls.circle[b, 2]])
            ball = PressedBall(circle, balls.radius[b] / pixel, pixel)
            errors.append(ball.errors(*surface, judged))
        degrees[i], microns[i], share = np.mean(errors, axis=0)
        percent.append(share)
    if np.isfinite(degrees).any():
        quality |= {
            "heldout_normal_deg": float(np.nanmean(degrees)),
            "heldout_height_um": float(np.nanmean(microns)),
            "heldout_height_percent": float(np.nanmean(percent)),
        }
    return HeldOut(degrees, microns, quality)


def _measure(
    press: Press,
    judged: NDArray[np.bool_],
    sigma: Light,
    lights: LightPositions,
    pixel: float,
    uneven: float,
    lift: float,
) -> tuple[Slope, Height]:
    """Slope and height; unjudged pixels of the contact get the ball's slope, without errors."""
    inside = press.mask > 0
    height = press.height + inside * np.float32(lift)
    level = np.zeros_like(press.slope)
    # Without wrap: light behind the terminator is not judged here.
    measured = label_lights(press.light, sigma, lights, height, level, pixel, uneven, 0.0).slope
    slope = np.where(inside & ~judged, press.slope, measured)
    return slope, integrate_dct(slope, pixel)
