"""Measure on the presses the gain of leaving out shadowed LEDs."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import node
from tactograph.nodes import Film, LabelTurn, Light, Metrics, Noise, PixelSize
from tactograph.nodes.calibrate.ball.find_balls import FoundBalls
from tactograph.nodes.calibrate.rating.pressed_ball import PressedBall
from tactograph.nodes.calibrate.rating.verdict import Odds
from tactograph.nodes.height.integrate_dct import integrate_dct
from tactograph.nodes.light.light_noise import light_noise
from tactograph.nodes.optics.film import direct_share
from tactograph.nodes.optics.near_light import unwrapped, wrapped
from tactograph.nodes.optics.sheet import SheetHeight, SheetLight, cut
from tactograph.nodes.shadow.label_lights import label_lights
from tactograph.nodes.slope.height_slopes import height_slopes

CAUTIOUS_TURN_RAD = 0.8
"""Angle by which leaving out LEDs has to turn a normal if labels do harm, as at a crack."""
MIN_DIFFUSED_SHARE = 0.1
"""Mean share of diffused light above which shadows are bright; a clear gel has 0.25 to 0.4."""
MAX_JUDGED_BALLS = 12
"""Largest number of balls to measure, spread over all."""
REACH_RADII = 2.6
"""Half the side of the film around a ball that is integrated, in radii of the ball."""


class LabelGain(NamedTuple):
    """The angle for `label_lights`, and the gain of labels as a figure for people."""

    turn: LabelTurn
    quality: Metrics


@node
def judge_labels(
    image: SheetLight,
    light: SheetLight,
    matt: SheetLight,
    flat: Light,
    height: SheetHeight,
    film: Film,
    balls: FoundBalls,
    noise: Noise,
    pixel: PixelSize,
) -> LabelGain:
    """Compare heights of the presses with all labels and with few.

    In a gel that diffuses light shadows are bright, and leaving out an LED loses information:
    slopes around a ball become inconsistent, which bends the height inside.  So balls are measured
    with all labels, and with only those that turn a normal by `CAUTIOUS_TURN_RAD`.  If that pays
    (`Odds.pays`), only these are used; it cannot pay with a single ball, which has no standard
    error.  No label is fitted to a press, so all presses are held out.  If the film diffuses hardly
    any light, or if no ball has a shadow, all labels are kept.

    Parameters
    ----------
    image, light, matt
        K x S x W, the presses on a sheet (`sheet`): as captured, relative to the film at rest, and
        from `matt_presses`.
    flat : K x H x W, the film at rest
    height : S x W in mm, of the presses, from `press_slopes`
    film : the film that was fitted to the presses
    balls : circles B x 3 in px, radii in mm, and the press of each ball
    noise : (shot, read), from `estimate_noise`
    pixel : mm per px

    Returns
    -------
    ``turn`` for `label_lights`; on a film that diffuses light also ``labels_gain_deg``, by how much
    labels reduce the error of the normals of the balls' heights.
    """
    used = np.flatnonzero(balls.circle[:, 2] > 0)
    if film.diffuse.mean() < MIN_DIFFUSED_SHARE or not used.size:
        return LabelGain(0.0, {})
    sheets = [cut(sheet, flat.shape[1]) for sheet in (image, light, matt, height)]
    errors = np.array(
        [
            [*_errors([s[balls.of[ball]] for s in sheets], flat, film, balls, ball, noise, pixel)]
            for ball in used[:: -(-used.size // MAX_JUDGED_BALLS)]
        ]
    )
    every, cautious = errors.T
    cost = Odds().pays([*every], [*cautious]) if len(errors) > 1 else cautious[0] < every[0]
    gain = {"labels_gain_deg": float(np.median(cautious - every))}
    return LabelGain(CAUTIOUS_TURN_RAD if cost else 0.0, gain)


def _errors(
    press: list[NDArray[np.float32]],
    flat: Light,
    film: Film,
    balls: FoundBalls,
    ball: int,
    noise: Noise,
    pixel: float,
) -> Iterator[float]:
    """The mean angles between normals of a ball and of its height, with all labels and with few."""
    circle, radius = balls.circle[ball].astype(np.float64), float(balls.radius[ball]) / pixel
    rows, columns = (
        slice(max(0, int(at - REACH_RADII * radius)), int(at + REACH_RADII * radius) + 2)
        for at in circle[1::-1]
    )
    raw, relative, matt, height = (image[..., rows, columns] for image in press)
    sigma = light_noise(raw, flat[:, rows, columns], noise)
    sigma = np.hypot(sigma, np.float32(film.grain) * relative)
    sigma /= direct_share(film)[:, None, None]
    light, sigma = unwrapped(wrapped(matt, film.wrap), sigma, film.wrap)
    corner = np.array([columns.start, rows.start, 0])
    middle = corner + np.array([*np.subtract(height.shape[::-1], flat.shape[:0:-1]) / 2, 0])
    lights = (film.lights - middle * pixel).astype(np.float32)
    level = np.zeros((2, *height.shape), np.float32)
    inputs = light, sigma, lights, height, level, pixel, film.uneven, film.wrap
    for turn in (0.0, CAUTIOUS_TURN_RAD):
        surface = integrate_dct(label_lights(*inputs, turn).slope, pixel)
        slope = height_slopes(surface, pixel).slope
        yield PressedBall(circle - corner, radius, pixel).errors(slope, surface)[0]
