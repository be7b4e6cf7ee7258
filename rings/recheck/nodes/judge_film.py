"""Judge from today's untouched film whether a calibration is still valid, cause by cause.

Long because each cause has its sentence, and says what to do.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.rings.recheck.nodes.film_change import FilmChange
from tactograph.sdk import F4, FilmEvidence, Judged, PixelSize, node, robust_deviation

PLACE_PX, LED_DRIFT, LED_DRIFT_ACROSS = (
    FilmEvidence.prior(name).spread for name in ("place_px", "led_drift", "led_drift_across")
)
"""Deviations that are usual: of the image in px, of an LED's light and of its change across it."""
MAX_AMBIENT = 0.004
"""Tolerated light that comes from no LED, as a fraction of full scale: one 8-bit step."""
MAX_BLACK_LEVEL = 0.1
"""Highest black level of a camera, as a fraction of full scale."""
MIN_MARK_CHANGE = 0.015
"""Smallest change of albedo of a mark."""
SHARP_GRADIENT = 0.125
"""Gradient per px of a mark, relative to its depth, above which it lies in the film.  Marks on the
lens are out of focus."""
ANOTHER_SENSOR = "not that of the calibration: is this another sensor, or another lens?"


class Verdicts(NamedTuple):
    """One sentence for each cause, and the figures."""

    leds: str
    film: str
    lens: str
    ambient: str
    camera: str
    quality: dict[str, float]


@node
def judge_film(change: FilmChange, pixel: PixelSize) -> Verdicts:
    """Return a verdict on the LEDs, the film, the lens, ambient light and the camera.

    Parameters
    ----------
    change : as `film_change` returns it, between the calibration's flat frame and today's
    pixel : mm per px

    Returns
    -------
    Five sentences, which begin with "right" where nothing is wrong; ``light_percent/...`` of each
    LED; ``ambient_percent`` of full scale; ``shift_px``; ``dent_um``; the depth in per cent of the
    strongest mark in the film and on the lens; ``wrong``, the number of causes found.
    """
    strength, ambient, shift, albedo, dent = change
    scratches, spots = _marks(albedo)
    deepest, where = _dent(dent, pixel)
    moved, mark, spot = float(np.hypot(*shift)), _strongest(scratches), _strongest(spots)
    percents = change.light_percent()
    right = (
        f"right: {min(percents.values()):.1f} to {max(percents.values()):.1f} % of their light",
        "right: no dents, no scratches",
        "right: clean",
        "right: none",
        f"right: moved by {moved:.1f} px",
    )
    wrong = [
        _of_leds(strength),
        _of_film(deepest, where, scratches),
        f"a blurred spot of {100 * spot.depth:+.0f} % at {spot.x},{spot.y} px: clean the lens, or "
        "recalibrate with a new flat frame" * bool(spots),
        _of_ambient(ambient),
        f"the image has moved by {shift[0]:+.1f},{shift[1]:+.1f} px: fix the camera and calibrate "
        "again" * (moved > PLACE_PX),
    ]
    # No LED gives less than no light, no black level falls by more than it stood at, and no dent is
    # deeper than half the view.
    is_dark = bool(strength.min() <= 0) or ambient < -MAX_BLACK_LEVEL
    if is_dark or abs(deepest) > pixel * dent.shape[1] / 2:
        wrong = [ANOTHER_SENSOR] * len(wrong)
    quality = percents | {
        "ambient_percent": 100 * ambient,
        "shift_px": moved,
        "dent_um": 1e3 * deepest,
        "film_mark_percent": 100 * abs(mark.depth),
        "lens_mark_percent": 100 * abs(spot.depth),
        "wrong": float(sum(map(bool, wrong))),
    }
    leds, film, lens, around, camera = (bad or good for bad, good in zip(wrong, right, strict=True))
    return Verdicts(leds, film, lens, around, camera, quality)


class _Mark(NamedTuple):
    """Change of albedo, and position in px."""

    depth: float
    x: int
    y: int


def _marks(albedo: F4) -> tuple[list[_Mark], list[_Mark]]:
    """The marks in the film, which are sharp, and those on the lens, which are blurred."""
    standing = (np.abs(albedo) > max(_noise(albedo), MIN_MARK_CHANGE)).astype(np.uint8)
    count, labels = cv2.connectedComponents(standing, connectivity=8)
    steepness = np.hypot(*np.gradient(albedo))
    marks: tuple[list[_Mark], list[_Mark]] = [], []
    for number in range(1, count):
        inside: NDArray[np.intp] = np.flatnonzero(labels == number)
        deepest = inside[np.abs(albedo.flat[inside]).argmax()]
        depth = float(albedo.flat[deepest])
        y, x = divmod(int(deepest), albedo.shape[1])
        is_blurred = bool(steepness.flat[inside].max() <= SHARP_GRADIENT * abs(depth))
        marks[is_blurred].append(_Mark(depth, x, y))
    return marks


def _strongest(marks: list[_Mark]) -> _Mark:
    return max(marks, key=lambda mark: abs(mark.depth), default=_Mark(0.0, 0, 0))


def _noise(plane: F4) -> float:
    """What noise reaches in a map, normally distributed about 0 at each of its pixels."""
    return Judged.reach(plane.size) * float(robust_deviation(plane))


def _dent(dent: F4, pixel: float) -> tuple[float, tuple[int, int]]:
    """Height in mm of the strongest dent, and its position in px; 0 if there is none.

    Noise of slopes adds up to heights that are wide and low, so that slopes tell a dent from it.
    """
    by_y, by_x = np.gradient(dent, pixel)
    slopes = np.stack([by_y, by_x])
    # LEDs that drift across the image turn film by as much.
    if np.abs(slopes).max() < max(_noise(slopes), LED_DRIFT_ACROSS):
        return 0.0, (0, 0)
    y, x = np.unravel_index(int(np.abs(dent).argmax()), dent.shape)
    return float(dent[y, x]), (int(x), int(y))


def _of_leds(strength: F4) -> str:
    usual = float(np.median(strength))
    k = int(np.abs(strength / usual - 1).argmax())
    percent = 100 * float(strength[k]) / usual
    drift = Judged.reach(strength.size) * LED_DRIFT
    if abs(percent - 100) > 100 * drift:
        return (
            f"LED {k + 1} has {percent:.0f} % of the light that the others have: check it and its "
            "wire, then recalibrate"
        )
    if abs(usual - 1) > drift:
        return (
            f"all LEDs have {100 * usual:.0f} % of their light: check exposure, gain and supply; "
            "heights stay right as long as nothing is dark or saturated"
        )
    return ""


def _of_film(deepest: float, where: tuple[int, int], scratches: list[_Mark]) -> str:
    sentences = []
    if deepest:
        sentences.append(
            f"a dent of {1e3 * deepest:.0f} um at {where[0]},{where[1]} px, or something touches "
            "the film there"
        )
    if scratches:
        depth, x, y = _strongest(scratches)
        sentences.append(
            f"marks or scratches: {len(scratches)}, the strongest of {100 * depth:+.0f} % at "
            f"{x},{y} px"
        )
    cure = ": wipe the film and take its capture again; if it stays, recalibrate with a new flat "
    return " and ".join(sentences) + f"{cure}frame" * bool(sentences)


def _of_ambient(ambient: float) -> str:
    if ambient < -MAX_AMBIENT:
        return (
            f"the black level has changed: every image is {-100 * ambient:.1f} % of full scale "
            "darker, lit or not; check the camera's offset, or take an image with all LEDs off "
            "and recalibrate with it"
        )
    if ambient > MAX_AMBIENT:
        return (
            f"{100 * ambient:+.1f} % of full scale comes from no LED: keep other light out, or "
            "take an image with all LEDs off and recalibrate with it"
            + "; or is this another sensor?"
            * (ambient > MAX_BLACK_LEVEL)
        )
    return ""
