"""The mistake that explains a touch which is doubted: it is undone, and the light then fits.

The images are put in another order, mirrored, turned, or freed of a gamma, and solved as a matt
film would be: I_k = n . L_k / L_kz, relative to the flat frame.  How much is left of right touches
of the sensor is known.  The mistake is named whose undoing leaves least, the simplest of those that
leave the same; none, if that is as rare as a doubt, or what is left of the images as they are is
not.
"""

import math
from collections.abc import Callable, Iterator
from itertools import permutations
from typing import NamedTuple

import cv2
import numpy as np

from tactograph.nodes import F4, CoarseLight, LightPositions
from tactograph.nodes.trust._check import MIN_CELLS
from tactograph.nodes.trust._rest_evidence import CALM_DEPARTURE
from tactograph.nodes.trust.banded_rows import BANDS_TOLD, is_banded
from tactograph.nodes.trust.light_departure import MIN_ERROR

TRIED_ROWS, TRIED_COLUMNS = 30, 40
"""Cells on which mistakes are tried: few, since there are a hundred."""
MIN_LIGHT = 0.3
"""Light that is no shadow."""
RING_CELLS = 3
"""Width of the border at which film should be at rest."""
USUAL_GAMMA = 2.2
MAX_APART = 2e-3
"""Root mean square difference of two images that are one."""
MAX_ORDERS = 24
"""Orders of more than four LEDs are too many: only two of them are exchanged."""
IMAGES_SWAPPED = 2
"""Images out of place where two are exchanged."""
TURNED_IMAGES: dict[str, Callable[[F4], F4]] = {
    "mirrored left to right": lambda planes: planes[..., ::-1],
    "mirrored top to bottom": lambda planes: planes[..., ::-1, :],
    "turned by half": lambda planes: planes[..., ::-1, ::-1],
}
"""What undoes each way in which a camera may be held or its images turned."""


class _Mistake(NamedTuple):
    """What may have been done to the images, in words, and the images without it."""

    words: str
    light: F4


def likely_cause(
    light: CoarseLight,
    flat: CoarseLight,
    lights: LightPositions,
    share_of: Callable[[float], float],
    false_alarms: float,
) -> str:
    """Return the one mistake that explains a touch's light, in words; "" if none does.

    Parameters
    ----------
    light : K x h x w, relative to the film at rest
    flat : K x h x w, the film at rest
    lights : K x 3, in mm
    share_of : the share of right touches that leave as much, or more (`left_as_matt`)
    false_alarms : share from which on a touch is doubted
    """
    raw = light * flat
    if alike := _alike(raw):
        return alike
    if is_banded(light):
        return BANDS_TOLD
    if share_of(left_as_matt(light, flat, lights)) >= false_alarms:
        return ""
    small, rest = _resized(raw), _divisor(flat)
    tried = [(_left(taken / rest, lights), words) for words, taken in _mistakes(small)]
    least = min(left for left, _ in tried)
    if share_of(least) < false_alarms:
        return ""
    # Simple mistakes come first.
    return next(words for left, words in tried if left <= least + MIN_ERROR)


def left_as_matt(light: CoarseLight, flat: CoarseLight, lights: LightPositions) -> float:
    """Return what a matt film leaves of a touch's light, as `likely_cause` looks at it.

    Infinite where there is no touch, or one that goes below the film at rest.
    """
    return _left(_resized(light * flat) / _divisor(flat), lights)


def _alike(raw: F4) -> str:
    planes = raw / raw.mean(axis=(1, 2), keepdims=True)
    for k in range(1, len(planes)):
        for j in range(k):
            if float(np.sqrt(np.mean((planes[j] - planes[k]) ** 2))) < MAX_APART:
                return (
                    f"the images of LED {j + 1} and LED {k + 1} show the same light (check that "
                    "each LED is lit for its own image, and that none was copied)"
                )
    return ""


def _mistakes(raw: F4) -> Iterator[_Mistake]:
    """Simple ones first."""
    yield _Mistake(
        "the images look as if a gamma had been applied (record raw light: gamma and contrast off)",
        raw ** np.float32(USUAL_GAMMA),
    )
    yield _Mistake("the images look like negatives: bright where film is dark", 1 - raw)
    others = [order for order in _orders(len(raw)) if _moved(order)]
    for order in others:
        if _moved(order) == IMAGES_SWAPPED:
            yield _Mistake(_words(order), raw[list(order)])
    for side, turn in TURNED_IMAGES.items():
        beside = "beside those of the calibration, with which they would fit"
        yield _Mistake(f"the images are {side} {beside}", turn(raw))
    for order in others:
        if _moved(order) > IMAGES_SWAPPED:
            yield _Mistake(_words(order), raw[list(order)])


def _orders(count: int) -> Iterator[tuple[int, ...]]:
    """Orders of LEDs, those with the fewest out of place first."""
    if math.factorial(count) <= MAX_ORDERS:
        yield from sorted(permutations(range(count)), key=_moved)
        return
    for one in range(count):
        for other in range(one):
            order = list(range(count))
            order[one], order[other] = other, one
            yield tuple(order)


def _moved(order: tuple[int, ...]) -> int:
    return sum(led != place for place, led in enumerate(order))


def _words(order: tuple[int, ...]) -> str:
    """What was done, for the order that undoes it: place k takes image order[k]."""
    wrong = [place for place, led in enumerate(order) if led != place]
    if len(wrong) == IMAGES_SWAPPED:
        return (
            f"the images of LED {wrong[0] + 1} and LED {wrong[1] + 1} are swapped: exchanged, they "
            "fit the calibration (check names and wires)"
        )
    right = ", ".join(str(led + 1) for led in order)
    return (
        f"the images are in another order than the calibration's: taken as {right} they fit it "
        "(check names and wires)"
    )


def _left(light: F4, lights: LightPositions) -> float:
    """What a matt film leaves of the light: residual, length of the normal, curl, film at rest."""
    light = light / np.median(light, axis=(1, 2), keepdims=True)
    directions = lights / lights[:, 2:]
    normal = np.tensordot(np.linalg.pinv(directions), light, 1)
    touched = (np.abs(light - 1) > CALM_DEPARTURE).any(axis=0)
    lit = touched & (light > MIN_LIGHT).all(axis=0)
    if np.count_nonzero(lit) < MIN_CELLS:
        return math.inf
    residual = (np.tensordot(directions, normal, 1) - light)[:, lit]
    length = np.sqrt((normal**2).sum(axis=0))[lit]
    p, q = -normal[:2] / np.maximum(normal[2], np.float32(0.2))
    (p_down, p_right), (q_down, q_right) = np.gradient(p), np.gradient(q)
    bends = sum(np.abs(part) for part in (p_down, p_right, q_down, q_right))
    curl = np.median(np.abs(p_down - q_right)[lit]) / max(float(np.median(bends[lit])), 1e-6)
    ring = np.ones(touched.shape, bool)
    ring[RING_CELLS:-RING_CELLS, RING_CELLS:-RING_CELLS] = False
    rest = np.median(np.abs(light - 1).max(axis=0)[ring])
    # The mean height over the touch is that of the slopes along the way to its middle.
    y, x = np.mgrid[: touched.shape[0], : touched.shape[1]]
    outwards = (x - x[touched].mean()) * p + (y - y[touched].mean()) * q
    if float(outwards[lit].sum()) > 0:
        return math.inf
    deviation = float(np.sqrt((residual**2).mean()))
    return deviation + float(np.median(np.abs(length - 1)) + curl + rest)


def _divisor(flat: F4) -> F4:
    return np.maximum(_resized(flat), np.float32(1e-3))


def _resized(planes: F4) -> F4:
    small = [
        cv2.resize(plane, (TRIED_COLUMNS, TRIED_ROWS), interpolation=cv2.INTER_AREA)
        for plane in planes
    ]
    return np.asarray(small, np.float32)
