"""Find the mistake that explains a doubted touch: undo it, and test whether the light then fits.

The images are reordered, mirrored, turned, or freed of a gamma, and solved as a matt film under far
LEDs: I_k = n . L_k / L_kz, relative to the flat frame.  The calibration knows the residual of right
touches.  The mistake is named whose undoing leaves the smallest residual; of equals, the simplest.
None is named if even that residual is rare among valid touches, or if the residual of the images as
they are is not.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from itertools import chain, combinations
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, CoarseLight, LightPositions
from tactograph.nodes.light.film_drift import CALM_DEPARTURES
from tactograph.nodes.trust.banded_rows import BANDS_WARNING, is_banded
from tactograph.nodes.trust.checked_cells import (
    DARK_LIGHT,
    MIN_CELLS,
    MIN_LEDS,
    MIN_LIGHT,
    few_cells,
)
from tactograph.nodes.trust.explained import explained
from tactograph.nodes.trust.fall_off import RING_CELLS, border_cells
from tactograph.nodes.trust.light_departure import MIN_ERROR
from tactograph.nodes.trust.other_frame import TURNED_IMAGES

USUAL_GAMMA = 2.2
"""Gamma to try; a contrast is reported if it is nearer to this, or to its inverse, than to 1."""

OTHER_CONTRAST = (
    "the film at rest has {times:.2g} times the contrast of the flat frame (switch off gamma, "
    "automatic contrast and histogram equalisation, and check that the calibration is this "
    "sensor's)"
)
OTHER_FILM = (
    "the film at rest is brighter in places and darker in others, under all LEDs alike (check that "
    "it is the film of the calibration, and that film and lens are clean)"
)
LOCAL_CONTRAST = (
    "the film at rest has {times:.2g} times the contrast of the flat frame from place to place, "
    "but not as a whole (switch off local contrast, such as CLAHE or HDR)"
)


class _Mistake(NamedTuple):
    """A mistake in words, and the images (and their LEDs) with the mistake undone."""

    words: str
    light: F4
    leds: slice | list[int] = slice(None)


def likely_cause(
    light: CoarseLight,
    flat: CoarseLight,
    lights: LightPositions,
    fits: Callable[[float], bool],
    *,
    has_moved: bool = False,
    has_walls: bool = False,
) -> str:
    """Return the one mistake that explains a touch's light, in words; "" if none does.

    Parameters
    ----------
    light : K x h x w, relative to the film at rest
    flat : K x h x w, the film at rest
    lights : K x 3, in mm
    fits : whether a residual is usual among valid touches (`matt_residual`)
    has_moved : whether camera or film has moved (`film_motion`, `image_shifts`)
    has_walls : whether rims alone may explain the light
    """
    raw = light * flat
    if alike := _alike(raw):
        return alike
    if is_banded(light):
        return BANDS_WARNING
    small, rest = few_cells(raw), np.maximum(few_cells(flat), MIN_LIGHT)

    def first_of(mistakes: Iterable[_Mistake]) -> str:
        """The first mistake with the smallest residual, if that fits."""
        candidates = [
            (_unexplained(m.light / rest[m.leds], lights[m.leds]), m.words) for m in mistakes
        ]
        least = min(residual for residual, _ in candidates)
        simplest = next(words for residual, words in candidates if residual <= least + MIN_ERROR)
        return simplest if fits(least) else ""

    if fits(_unexplained(small / rest, lights)):
        return _at_border(small, rest)
    # Fewer LEDs always fit better, and more so if the camera has moved or an LED is shaded.
    may_be_foreign = len(raw) > MIN_LEDS and not has_moved and not has_walls
    in_part = chain(_torn(small), _without_one(small) if may_be_foreign else ())
    # Simple mistakes come first: a part of the images is explained by more mistakes.
    return first_of(_mistakes(small)) or _at_border(small, rest) or first_of(in_part)


def matt_residual(light: CoarseLight, flat: CoarseLight, lights: LightPositions) -> float:
    """Return the residual of a touch's light as that of a matt film under far LEDs.

    It is infinite if there is no touch, or if the touch goes below the film at rest.
    """
    rest = np.maximum(few_cells(flat), MIN_LIGHT)
    return _unexplained(few_cells(light * flat) / rest, lights)


def _at_border(raw: F4, rest: F4) -> str:
    """What changed the film at rest along the border, in words: a contrast, or the film itself.

    A contrast is the slope of the logarithm of the light over that of the flat frame; unchanged
    light has contrast 1 everywhere.  A change of the film's albedo is the same under all LEDs.
    """
    # Black parts of the image show no film.
    ring = border_cells(raw.shape[1:], RING_CELLS) & (raw > DARK_LIGHT * rest).any(axis=0)
    if not ring.any():
        return ""
    logged = np.log(np.maximum(np.stack([raw, rest]), MIN_LIGHT))
    touched, due = logged[:, :, ring]
    if times := _contrast(touched, due):
        return OTHER_CONTRAST.format(times=times)
    apart = touched - due
    if explained(apart, np.broadcast_to(apart.mean(axis=0), (1, *apart.shape))).any():
        return OTHER_FILM
    means = [[cv2.GaussianBlur(plane, (0, 0), RING_CELLS) for plane in planes] for planes in logged]
    times = _contrast(*(logged - means)[:, :, ring])
    return LOCAL_CONTRAST.format(times=times) if times else ""


def _contrast(touched: F4, due: F4) -> float:
    """The contrast of the light relative to the flat frame, both K x N in logarithms; or 0."""
    times = float(explained(touched, due[None])[0])
    return times if times > 0 and abs(math.log(times)) >= math.log(USUAL_GAMMA) / 2 else 0.0


def _alike(raw: F4) -> str:
    planes = raw / np.maximum(raw.mean(axis=(1, 2), keepdims=True), MIN_LIGHT)
    for j, k in combinations(range(len(planes)), 2):
        if float(np.sqrt(np.mean((planes[j] - planes[k]) ** 2))) < MIN_ERROR:
            return (
                f"the images of LED {j + 1} and LED {k + 1} show the same light (check that each "
                "LED is lit for its own image, and that none was copied)"
            )
    return ""


def _mistakes(raw: F4) -> Iterator[_Mistake]:
    """All mistakes to try, the simple ones first."""
    yield _Mistake(
        "the images look as if a gamma had been applied (record raw light: gamma and contrast off)",
        raw ** np.float32(USUAL_GAMMA),
    )
    yield _Mistake("the images look like negatives: bright where film is dark", 1 - raw)
    if raw.shape[1] == raw.shape[2]:
        # The two are indistinguishable if LEDs stand symmetrically to the diagonal.
        yield _Mistake(
            "the images are transposed, or those of two LEDs across the diagonal are swapped (rows "
            "have to be rows; check names and wires)",
            raw.transpose(0, 2, 1),
        )
    ring = tuple(range(len(raw)))
    swaps = [
        tuple({one: other, other: one}.get(k, k) for k in ring)
        for one, other in combinations(ring, 2)
    ]
    yield from (_exchanged(raw, order) for order in swaps)
    for side, turn in TURNED_IMAGES.items():
        hint = "compared with the calibration's; turned back they would fit"
        yield _Mistake(f"the images are {side} {hint}", turn(raw))
    # The ring of LEDs starts elsewhere, or runs the other way round.
    orders = (way[k:] + way[:k] for way in (ring, ring[::-1]) for k in ring)
    yield from (_exchanged(raw, order) for order in orders if order not in {ring, *swaps})


def _exchanged(raw: F4, order: tuple[int, ...]) -> _Mistake:
    """The mistake that is undone by taking image `order[k]` for LED k."""
    moved = [f"LED {place + 1}" for place, led in enumerate(order) if led != place]
    right = ", ".join(str(led + 1) for led in order)
    words = f"are in another order than the calibration's: taken as {right} they fit it"
    if len(moved) == 2:
        words = f"of {' and '.join(moved)} are swapped: exchanged, they fit the calibration"
    return _Mistake(f"the images {words} (check names and wires)", raw[list(order)])


def _torn(raw: F4) -> Iterator[_Mistake]:
    """Frames whose last rows show the previous or the next LED."""
    for row in range(1, raw.shape[1]):
        for by, which in (1, "next"), (-1, "previous"):
            whole = np.concatenate([raw[:, :row], np.roll(raw[:, row:], by, 0)], axis=1)
            yield _Mistake(
                f"frames are torn: from {row / raw.shape[1]:.0%} of their height on they show the "
                f"{which} LED (get complete frames by a slower camera, or a shorter cable)",
                whole,
            )


def _without_one(raw: F4) -> Iterator[_Mistake]:
    for led in range(len(raw)):
        others = [k for k in range(len(raw)) if k != led]
        yield _Mistake(
            f"the image of LED {led + 1} is not of the touch that the others show (check that it "
            "is of this touch, and that nothing moved)",
            raw[others],
            others,
        )


def _unexplained(light: NDArray[Any], lights: LightPositions) -> float:
    """The misfit of a matt film: residual, length of the normal, curl, and film at rest."""
    median = np.median(light, axis=(1, 2), keepdims=True)
    light = np.asarray(light / np.maximum(median, MIN_LIGHT), np.float32)
    directions = lights / lights[:, 2:]
    normal = np.tensordot(np.linalg.pinv(directions), light, 1)
    touched = (np.abs(light - 1) > CALM_DEPARTURES[0]).any(axis=0)
    lit = touched & (light > DARK_LIGHT).all(axis=0)
    if np.count_nonzero(lit) < MIN_CELLS:
        return math.inf
    residual = (np.tensordot(directions, normal, 1) - light)[:, lit]
    length = np.sqrt((normal**2).sum(axis=0))[lit]
    p, q = -normal[:2] / np.maximum(normal[2], np.float32(0.2))
    (p_down, p_right), (q_down, q_right) = np.gradient(p), np.gradient(q)
    bends = sum(np.abs(part) for part in (p_down, p_right, q_down, q_right))
    curl = np.median(np.abs(p_down - q_right)[lit]) / max(float(np.median(bends[lit])), 1e-6)
    rest = np.median(np.abs(light - 1).max(axis=0)[border_cells(touched.shape, RING_CELLS)])
    # The slopes along the way to the middle of the touch sum up to its mean height.
    y, x = np.mgrid[: touched.shape[0], : touched.shape[1]]
    outwards = (x - x[touched].mean()) * p + (y - y[touched].mean()) * q
    if float(outwards[lit].sum()) > 0:
        return math.inf
    deviation = float(np.sqrt((residual**2).mean()))
    return deviation + float(np.median(np.abs(length - 1)) + curl + rest)
