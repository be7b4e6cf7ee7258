"""Which LED a frame was exposed with, by its image alone.

The film at rest looks different under every LED, and the calibration knows how.  What of the
film is untouched in a frame is therefore a sum of the flat frames, one of which has weight 1
and all others 0; a rolling shutter that saw two LEDs shows other weights in other rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, Dark, Light

Plane = NDArray[np.uint8] | NDArray[np.uint16]
Kind = Literal["one", "off", "mixed", "saturated", "covered", "unclear", "wrong size"]
ROWS = 60
"""Frames are averaged down to about so many rows before they are looked at."""
BANDS = 6
"""Bands of rows, each with weights of its own."""
TOLERANCE = 0.04
"""A cell is at rest if it is so close to an LED's pattern, as a share of the light."""
AT_REST = 0.01
"""A cell is surely at rest if it is so close to the sum that fits the film best."""
NOISE = 0.005
"""What the film at rest strays from its pattern, as a share of the light."""
QUANTILE = 0.4
"""A band is judged by this quantile of its cells: more than half of it may be touched."""
EXPLAINS = 0.4
"""A second LED explains a band if that leaves so much of what was not explained."""
MARGIN = 0.3
"""An LED is certain if others are worse by this share of what they should be worse by."""
FAINTEST = 0.02
"""Cells darker than this on the film at rest say nothing; as for `flat_field`."""
OFF = 0.12
"""A frame is dark below this share of the film's light."""
MOST_SATURATED = 0.03
"""Share of pixels at full scale above which a frame is refused."""
MOST_OF_ANOTHER = 0.04
"""Weight of a second LED, or lack of the first, above which a frame is mixed."""
LEAST_AT_REST = 0.15
"""Share of the film at rest below which nothing can be said at all."""
DIMMEST, BRIGHTEST = 0.5, 1.8
"""Range of an LED's brightness, 1 as calibrated."""
FITS = 4
"""Robust fits, each leaving out what the one before did not explain."""


@dataclass(frozen=True)
class Film:
    """The film at rest, as `see` compares frames with it.

    Parameters
    ----------
    patterns
        K x h x w: each LED's flat frame, averaged over cells.
    dark
        h x w: all LEDs off.
    size
        H, W of the camera's frames.
    """

    patterns: F4
    dark: F4
    size: tuple[int, int]


class Sight(NamedTuple):
    """What one frame shows."""

    kind: Kind
    led: int = 0
    """The LED that the film is closest to; 0 unless `kind` is "one" or "mixed"."""
    gain: float = 0.0
    """Its brightness, 1 as calibrated."""
    other: int = 0
    """Of a mixed frame: the second LED, 0 for none lit."""
    at_rest: float = 0.0
    """Share of the film that is seen at rest."""
    share: float = 0.0
    """Of a mixed frame: the second LED's share of the light."""


def make_film(flat: Light, dark: Dark | None = None) -> Film:
    """Prepare the calibration's flat frames (K x H x W) and dark frame (H x W)."""
    patterns = np.stack([cells(plane) for plane in flat])
    none = np.zeros(flat.shape[1:], np.float32)
    return Film(patterns, cells(none if dark is None else dark), flat.shape[1:])


def see(frame: Plane, film: Film, full: float = 0.0) -> Sight:
    """Say which LED lit a frame, from its image alone.

    Parameters
    ----------
    frame
        H x W as the camera gave it.
    film
        What the film at rest looks like.
    full
        The camera's largest value; 0: that of the frame's type.
    """
    if frame.shape != film.size:
        return Sight("wrong size")
    top = full or float(np.iinfo(frame.dtype).max)
    if np.count_nonzero(frame >= top) > MOST_SATURATED * frame.size:
        return Sight("saturated")
    light = cells(frame) / np.float32(top) - film.dark
    patterns = np.maximum(film.patterns, np.float32(FAINTEST))
    brightness = np.median((light / patterns).reshape(len(patterns), -1), axis=1)
    if brightness.max() < OFF:
        return Sight("off")
    best, gain, certain = _closest(light, patterns)
    bands = [_fit(*band, best, gain) for band in _bands(light, patterns)]
    at_rest = float(np.mean([band.at_rest for band in bands]))
    mixed = [band.weights for band in bands if band.mixed]
    if mixed:
        weights = np.mean([band.weights for band in bands], axis=0)
        other = _another(mixed, best)
        share = float(weights[other - 1] / weights.sum()) if other else 0.0
        return Sight("mixed", best + 1, float(weights[best]), other, at_rest, share)
    if at_rest < LEAST_AT_REST:
        return Sight("covered", at_rest=at_rest)
    if not certain:
        return Sight("unclear", at_rest=at_rest)
    if not DIMMEST < gain < BRIGHTEST:
        return Sight("mixed", best + 1, gain, 0, at_rest)
    return Sight("one", best + 1, gain, 0, at_rest)


def _closest(light: F4, patterns: F4) -> tuple[int, float, bool]:
    """The LED whose pattern is closest, its brightness, and whether no other is as close."""
    count = len(patterns)
    flat = patterns.reshape(count, -1)
    ratio = light.ravel() / flat
    gains = np.maximum(np.median(ratio, axis=1), np.float32(1e-3))
    apart = _truncated(ratio / gains[:, None] - 1)
    best = int(apart.mean(axis=1).argmin())
    # What the other LEDs' patterns would add if this one is right, on the film at rest.
    wrong = flat[best] / flat
    wrong = _truncated(wrong / np.median(wrong, axis=1)[:, None] - 1)
    rest = apart[best] < np.float32(TOLERANCE**2)
    added = ((apart - apart[best]) * rest).mean(axis=1)
    expected = (wrong * rest).mean(axis=1)
    others = np.arange(count) != best
    certain = bool((added[others] > MARGIN * expected[others]).all() and rest.any())
    return best, float(gains[best]), certain


def _truncated(off: F4) -> F4:
    limited = np.minimum(np.abs(off), np.float32(TOLERANCE))
    return np.asarray(limited * limited, np.float32)


class _Band(NamedTuple):
    """Some rows: their weights, whether they need more than one LED, their share at rest."""

    weights: NDArray[np.float64]
    mixed: bool
    at_rest: float


def _bands(light: F4, patterns: F4) -> list[tuple[F4, F4]]:
    """Rows of the light and of the patterns."""
    count = min(BANDS, light.shape[0])
    split = np.array_split(light, count), np.array_split(patterns, count, axis=1)
    return [(x.ravel(), y.reshape(len(patterns), -1)) for x, y in zip(*split, strict=True)]


def _fit(light: F4, patterns: F4, best: int, gain: float) -> _Band:
    """Explain a band by one LED, and if that fails by several.

    A touch is explained by neither, so the question is not whether the film is at rest but
    whether most of the band follows from a second LED and does not without it.
    """
    scale = np.float32(1) / (np.float32(gain) * patterns[best])
    basis, target = patterns * scale, light * scale
    alone = np.abs(target - 1)
    single = np.zeros(len(patterns))
    single[best] = gain
    at_rest = float((alone < TOLERANCE).mean())
    unexplained = float(np.quantile(alone, QUANTILE))
    if unexplained < NOISE:
        return _Band(single, False, at_rest)
    fits = [_pair(basis, target, best, second) for second in range(len(basis)) if second != best]
    weights, off = min(fits, key=lambda fit: fit[1])
    others = np.delete(weights, best)
    sensible = weights.min() > -MOST_OF_ANOTHER * gain and weights.sum() < BRIGHTEST * gain
    strays = max(others.max(), abs(weights[best] - gain)) > MOST_OF_ANOTHER * gain
    return _Band(weights, bool(sensible and strays and off < EXPLAINS * unexplained), at_rest)


def _pair(basis: F4, target: F4, first: int, second: int) -> tuple[NDArray[np.float64], float]:
    """Explain a band by two LEDs: least squares that ends on the cells it explains.

    Returns
    -------
    The weights, and the `QUANTILE` of what stays unexplained.
    """
    two = basis[[first, second]]
    used = np.ones(target.size, np.float32)
    weights: NDArray[np.float64] = np.zeros(2)
    off = target
    for _ in range(FITS):
        weighted = two * used
        normal = (weighted @ two.T).astype(np.float64)
        normal[np.diag_indices(2)] += 1e-6 * used.size
        weights[:] = np.linalg.solve(normal, (weighted @ target).astype(np.float64))
        off = np.abs(weights.astype(np.float32) @ two - target)
        used = (off < max(NOISE, 1.5 * float(np.median(off)))).astype(np.float32)
    shares = np.zeros(len(basis))
    shares[[first, second]] = weights
    return shares, float(np.quantile(off, QUANTILE))


def reach(light: F4, patterns: F4, led: int, before: int, after: int) -> float:
    """How much more of the LED after it than of the one before it lies in a frame.

    An exposure that begins too early or ends too late has a little of one neighbour in it and
    nothing of the other.  What the film has changed since the calibration looks like a little
    of both, and cancels.

    Parameters
    ----------
    light, patterns
        Cells of the frame, h x w, and of the film at rest, K x h x w.
    led, before, after
        The LED of the frame and its neighbours in the cycle, 0 for a dark one.

    Returns
    -------
    float
        Share of the light: positive is the LED after.
    """
    numbers = [led, *(other for other in dict.fromkeys((before, after)) if other not in (0, led))]
    scale = np.float32(1) / patterns[led - 1].ravel()
    basis = patterns[[number - 1 for number in numbers]].reshape(len(numbers), -1) * scale
    target = light.ravel() * scale
    off = np.abs(target / np.median(target) - 1)
    weights = np.zeros(len(numbers))
    for limit in (TOLERANCE, AT_REST, AT_REST):
        used = basis * (off < limit)
        normal = (used @ basis.T).astype(np.float64) + 1e-6 * off.size * np.eye(len(numbers))
        weights = np.linalg.solve(normal, (used @ target).astype(np.float64))
        off = np.abs(weights.astype(np.float32) @ basis - target)
    shares = dict(zip(numbers, weights / max(weights.sum(), 1e-6), strict=True))
    return float(shares.get(after, 0.0) - shares.get(before, 0.0)) if before != after else 0.0


def _another(mixed: list[NDArray[np.float64]], best: int) -> int:
    """The second LED of mixed bands; 0 if the first one is only partly exposed."""
    share = np.mean(mixed, axis=0)
    share[best] = 0
    return int(share.argmax()) + 1 if share.max() > MOST_OF_ANOTHER else 0


def cells(plane: NDArray[np.generic]) -> F4:
    """Return means over square cells, about `ROWS` rows of them: noise averages out."""
    factor = max(1, round(plane.shape[0] / ROWS))
    size = max(plane.shape[1] // factor, 1), max(plane.shape[0] // factor, 1)
    small = cv2.resize(plane.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32)
