"""Rate a calibration by a few figures.

Long because each bad figure has a sentence about the likely cause and what to check.
"""

from typing import Annotated, NamedTuple

import numpy as np

from tactograph.graph import InputError, Port, node, warn
from tactograph.nodes import (
    F4,
    Albedo,
    Light,
    LightPositions,
    LutSlope,
    Metrics,
    Noise,
    PixelSize,
    Spread,
)
from tactograph.nodes.calibrate import MAX_LED_WIDTHS
from tactograph.nodes.calibrate.film.judge_radius import ONLY_WARN_ADVICE
from tactograph.nodes.calibrate.lights.light_samples import is_uniform
from tactograph.nodes.calibrate.lights.other_press import MIN_ANGLE_DEG
from tactograph.nodes.calibrate.rating.verdict import Judged
from tactograph.nodes.light.light_noise import rest_noise
from tactograph.nodes.optics.sheet import SheetLabels, SheetMask

MIN_STEEPEST_SLOPE, SECTOR_COUNT = 0.5, 16
"""Slope that the tables should cover in every direction, and the number of directions."""
MAX_LIGHT_MISMATCH = 0.03
MAX_NOISE_RATIO = 1.3
"""Multiple of the camera's noise up to which a departure counts as noise."""
RING_SLANT_DEG = 15.0
"""Range of the slants of LEDs in one ring."""
HELDOUT_FIGURE = "film_heldout_deg"
MAX_ALBEDO, MAX_REFRACTION = 0.94, 1.59
"""Albedo and refraction of a coat just below the largest that `fit_film` allows."""


class Rating(NamedTuple):
    """Figures, doubts about the calibration (one sentence each), and the verdict."""

    quality: Metrics
    doubts: list[str]
    verdict: str


class LedFit(NamedTuple):
    """The places of the LEDs, the residuals of their fit, and, where it was fitted, the film."""

    lights: LightPositions
    residual: Annotated[F4, Port("K", "1")]
    albedo: Albedo | None = None
    refraction: Annotated[float, Port(unit="1")] | None = None


@node
def rate_calibration(
    residual: Annotated[F4, Port("K", "1")],
    spread: Spread,
    lut_slope: LutSlope,
    mask: SheetMask,
    lit: SheetLabels,
    model: LedFit,
    goodness: Annotated[F4, Port("B", "1")] | None = None,
    flat: Light | None = None,
    noise: Noise | None = None,
    pixel: PixelSize | None = None,
    radius: Judged | None = None,
    other_doubts: list[str] | None = None,
    *,
    only_warn: bool = False,
) -> Rating:
    """Return the figures that distinguish a good calibration from a bad one; doubt a bad one.

    Parameters
    ----------
    residual
        Standard deviation of the reflectance fit per LED; the film at rest is 1.  It is a figure
        of the paper's tables: light need not be a smooth function of the slope.
    spread : standard deviation of a.I on lit pixels
    lut_slope : N x 2, the slopes in the tables
    mask, lit : S x W, the pixels of known slope, and the LEDs that reach them
    model
        `fit_film` or `calibrate_lights`: the LEDs, K x 3 in mm, the standard deviation of what
        their fit leaves, K, and the film's albedo and refraction
    goodness : of each ball, 0 to 1; 0 where none was found
    flat, noise
        K x H x W, the film at rest, and the camera's noise, from `estimate_noise`.
        Residuals within the noise give no warning of a poor fit.
    pixel : mm per px
    radius : `judge_radius`: figures (including those of the fit), doubts, and what is unconfirmed
    other_doubts : the doubts of other nodes
    only_warn
        Whether to accept a ball's radius and a pixel size that contradict each other, with a doubt.

    Returns
    -------
    The doubts, each of them also a warning; the verdict, one sentence for people; and the figures:
    ``entries``; ``steepest_slope`` that the tables cover in every direction; ``residual_percent``,
    the largest of all LEDs; ``spread_percent``; ``fully_lit_percent`` of the known pixels;
    ``near_light_residual_percent``, the largest of all LEDs; the lowest ``ball_goodness``; and for
    comparison with the sensor, for each LED ``slant_deg/led1`` from the camera's axis,
    ``azimuth_deg/led1`` from x (right) towards y (down), ``distance_mm/led1`` from the middle of
    the image.

    Raises
    ------
    InputError
        If the ball's radius and the pixel size contradict each other: LEDs at infinity, or a film
        that returns all light; unless `only_warn` is set.
    """
    count = len(residual)
    lights, mismatch, albedo, refraction = model
    figures, radius_doubts, unconfirmed = radius or Judged({}, [])
    heldout = Judged.of_heldout(HELDOUT_FIGURE, figures.get(HELDOUT_FIGURE))
    steepest, grain = _covered_everywhere(lut_slope), _grain(flat, noise, count)
    noisiest = int(np.argmax(grain))
    if MAX_NOISE_RATIO * grain[noisiest] > MAX_LIGHT_MISMATCH:
        warn(
            f"LED {noisiest + 1}'s images are noisy, by {grain[noisiest]:.1%} of the film's light: "
            "expose longer"
        )
    if steepest < MIN_STEEPEST_SLOPE:
        warn(
            f"the tables cover slopes up to {steepest:.2f} only; press deeper, or use a "
            "smaller ball"
        )
    doubts = [*(other_doubts or []), *heldout.doubts, *radius_doubts]
    poorest = int(np.argmax(mismatch))
    is_poor = mismatch[poorest] > max(MAX_LIGHT_MISMATCH, MAX_NOISE_RATIO * grain[poorest])
    if is_poor:
        doubts.append(
            f"LED {poorest + 1}'s light departs by {mismatch[poorest]:.1%} from that of a point "
            "above a matt film: check the order of the images, the ball's radius and contact (or "
            "the object's height) and the pixel size"
            + (", or give `flat`=DIR" if flat is None or is_uniform(flat) else "")
            + "; a film that is glossy departs, too"
        )
    twins = _of_twins(lights)
    doubts += twins
    if pixel is not None and albedo is not None:
        # At the largest index, coat and albedo trade off against each other at any radius.
        is_open = refraction is not None and refraction > MAX_REFRACTION
        is_explained = not radius_doubts and not is_poor
        scale = pixel * mask.shape[1], 0.0 if is_open else albedo
        contradiction = _of_scale(lights, *scale, is_explained)
        if contradiction and not only_warn:
            raise InputError((other_doubts or contradiction)[0] + ONLY_WARN_ADVICE)
        doubts += contradiction
    for doubt in doubts:
        warn(doubt)
    if not twins:
        _note_order(lights)
    in_contact = mask > 0
    rated = {
        "entries": float(len(lut_slope)),
        "steepest_slope": steepest,
        "residual_percent": float(100 * residual.max()),
        "spread_percent": 100 * spread,
        "fully_lit_percent": float(100 * (lit[in_contact] == (1 << count) - 1).mean()),
        "near_light_residual_percent": float(100 * mismatch[poorest]),
    }
    if goodness is not None:
        rated["ball_goodness"] = float(goodness[goodness > 0].min(initial=1))
    return Rating(
        rated | _directions(lights),
        doubts,
        heldout._replace(doubts=doubts, unconfirmed=unconfirmed).verdict(HELDOUT_FIGURE),
    )


def _grain(flat: Light | None, noise: Noise | None, count: int) -> F4:
    """The standard deviation of a pixel's light on the film at rest, by LED; 0 if unknown."""
    if flat is None or noise is None:
        return np.zeros(count, np.float32)
    return rest_noise(np.median(flat.reshape(count, -1), axis=1), noise, floor=1e-3)


def _of_twins(lights: LightPositions) -> list[str]:
    """A doubt if two LEDs light the film from the same direction."""
    away = lights / np.linalg.norm(lights, axis=1, keepdims=True)
    alike = np.triu(away @ away.T > np.cos(np.radians(MIN_ANGLE_DEG)), 1)
    return [
        f"LEDs {one + 1} and {other + 1} light the film from the same place: is led{other + 1} a "
        f"copy of led{one + 1}, or does the same LED flash twice?"
        for one, other in np.argwhere(alike)[:1]
    ]


def _note_order(lights: LightPositions) -> None:
    """Warn of LEDs in one ring that are not numbered around it: the images may be swapped.

    The light cannot show that: images that are swapped alike in balls, flat frame and touches give
    a right height.
    """
    slant = np.degrees(np.arctan2(np.hypot(lights[:, 0], lights[:, 1]), lights[:, 2]))
    if slant.min() < MIN_ANGLE_DEG or np.ptp(slant) > RING_SLANT_DEG:
        return
    around = np.argsort(np.arctan2(lights[:, 1], lights[:, 0]))
    steps = np.diff(around, append=around[:1]) % len(lights)
    if not ((steps == 1).all() or (steps == len(lights) - 1).all()):
        order = ", ".join(str(k + 1) for k in np.roll(around, -int(np.argmin(around))))
        warn(
            f"the LEDs stand around the film in the order {order}: if they are numbered around "
            "it, images are swapped"
        )


def _of_scale(
    lights: LightPositions, width_mm: float, albedo: float, is_explained: bool
) -> list[str]:
    """A doubt if only a wrong ball radius or pixel size explains the film.

    A fit compensates slopes that are too steep or too flat by LEDs at infinity, or by light from
    film to film.  Parallel light, as from telecentric lamps, is accepted if it explains the light
    and no other radius explains it better.
    """
    distance = np.linalg.norm(lights, axis=1)
    farthest = int(np.argmax(distance))
    if distance[farthest] > MAX_LED_WIDTHS * width_mm and not is_explained:
        return [
            f"LED {farthest + 1} is found {distance[farthest] / 1000:,.4g} m from the film, more "
            f"than {MAX_LED_WIDTHS:.0f} widths of the image: check the ball's radius, the pixel "
            "size and the order of the images"
        ]
    if albedo > MAX_ALBEDO:
        return [
            f"the film's albedo is found as {albedo:.2f}, the largest possible: check the "
            "ball's radius and the pixel size"
        ]
    return []


def _directions(lights: LightPositions) -> Metrics:
    """Slant, azimuth and distance of each LED, for comparison with the sensor."""
    rated: Metrics = {}
    for k, (x, y, z) in enumerate(lights.astype(np.float64), start=1):
        rated[f"slant_deg/led{k}"] = float(np.degrees(np.arctan2(np.hypot(x, y), z)))
        rated[f"azimuth_deg/led{k}"] = float(np.degrees(np.arctan2(y, x)))
        rated[f"distance_mm/led{k}"] = float(np.sqrt(x * x + y * y + z * z))
    return rated


def _covered_everywhere(lut_slope: LutSlope) -> float:
    """The slope up to which each of `SECTOR_COUNT` directions has entries."""
    azimuth = np.arctan2(lut_slope[:, 1], lut_slope[:, 0])
    sector = ((azimuth + np.pi) / (2 * np.pi) * SECTOR_COUNT).astype(int) % SECTOR_COUNT
    steep = np.zeros(SECTOR_COUNT)
    np.maximum.at(steep, sector, np.hypot(lut_slope[:, 0], lut_slope[:, 1]))
    return float(steep.min())
