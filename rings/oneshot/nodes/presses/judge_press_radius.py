"""Judge the ball's radius of a one-shot sensor by the light of its presses."""

from typing import Annotated

import numpy as np
from annotated_types import Gt
from scipy.special import chdtri

from tactograph.rings.oneshot.nodes.presses import Circles, PressImages
from tactograph.rings.oneshot.nodes.presses.sheet_presses import sheet_presses
from tactograph.sdk import (
    F4,
    U1,
    Film,
    FilmEvidence,
    FoundBalls,
    Judged,
    Light,
    PixelSize,
    Port,
    node,
)
from tactograph.sdk.nodes import flat_presses
from tactograph.sdk.unstable import (
    DEVIATIONS_PER_MAD,
    FALSE_ALARMS,
    MAX_JUDGED_BALLS,
    MIN_FLAT_LIGHT,
    Alternatives,
    Balls,
)

RADIUS_INPUTS = " (`radius_mm`, `pixel`)"


@node
def judge_press_radius(
    image: PressImages,
    flat: Light,
    circle: Circles,
    selection: Annotated[U1, Port("B", "flag", high=1)],
    pixel: PixelSize,
    balls: FoundBalls | None = None,
    *,
    radius_mm: Annotated[float, Gt(0)],
) -> Judged:
    """Fit a plain film under point lights with other radii, as `judge_radius` does.

    A reflectance map accepts any radius, because its coefficients have no scale; lights and a
    gel have one.

    Parameters
    ----------
    image, flat : P x K x H x W presses, levelled, and the K x H x W film at rest
    circle, selection : B x 3 in px, and the balls used, as `fit_reflectance_map` returns them
    pixel : mm per px
    balls : as `find_presses` returns them; None: every press has one ball
    radius_mm : the ball's radius

    Returns
    -------
    ``diffuse_percent``, the share of light that the gel seems to diffuse; ``matt``, 1 where a
    plain film explains the light but for noise, by a chi-squared test at `FALSE_ALARMS`; at most
    one doubt.
    """
    used = np.flatnonzero(selection)
    used = used[:: used.size // MAX_JUDGED_BALLS + 1]
    press_image = image[used if balls is None else balls.of[used]]
    sheet = flat_presses(sheet_presses(press_image), flat)
    radius = np.full(used.size, radius_mm, np.float32)
    every, no_noise = np.arange(used.size, dtype=np.int32), np.zeros(2, np.float32)
    lights, strength = np.ones((len(flat), 3), np.float32), np.ones(len(flat), np.float32)
    placed = np.ones(used.size, np.uint8), lights, strength
    evidence = FilmEvidence(sheet, flat, circle[used], radius, every, *placed, no_noise, pixel)
    # A matt film throws no light on itself, wherever its lights are.
    samples = evidence.sample(Film.matt(lights), most=None, fine=True)
    # The film at rest of such sensors is not lit by points.
    evidence = evidence._replace(flat=np.ones_like(flat), first_lights=_directions(samples))
    explained = Alternatives.of(evidence, samples, camera=None, coated=True)
    plain, scale = explained.stated, explained.scale_error()
    # What a coat explains better is no evidence of another radius or of a gamma.
    doubts, _ = explained.doubts(radius_mm, explained.departure, which=RADIUS_INPUTS)
    is_open = "" if doubts else explained.unconfirmed(radius_mm)
    quality = {"diffuse_percent": 100 * plain.diffuse, "scale_error_percent": 100 * scale}
    by_chance = chdtri(explained.values, FALSE_ALARMS) / explained.values
    noise = _noise(sheet) / float(np.median(samples.reference_light))
    if plain.departure**2 <= by_chance * noise**2:
        quality["matt"] = 1.0
    return Judged(quality, doubts, is_open)


def _noise(light: F4) -> float:
    """Standard deviation of a pixel's light, by differences of second order along the rows."""
    bends = np.diff(light, 2, axis=2)
    return float(DEVIATIONS_PER_MAD * np.median(np.abs(bends)) / np.sqrt(6))


def _directions(balls: Balls) -> F4:
    """Roughly where the lights are: distant ones, by linear least squares."""
    (nx, ny, nz), *_ = balls.surface(np.zeros((len(balls.centre), 3)), 0.0)
    directions = []
    for light in balls.light:
        lit = light > MIN_FLAT_LIGHT
        slant = np.linalg.lstsq(np.stack([nx, ny])[:, lit].T, light[lit] - nz[lit], rcond=None)[0]
        directions.append([*slant, 1.0])
    return np.asarray(directions, np.float32)
