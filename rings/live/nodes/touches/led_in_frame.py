"""Find from a frame's image alone which LED lit it.

The film at rest looks different under every LED, as the calibration's flat frames show.  So the
untouched film in a frame is a sum of the flat frames, of which one has weight 1 and all others
0.  A rolling shutter that saw two LEDs gives different weights in different rows.
"""

from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.rings.frames.rest_film import (
    MAX_DEPARTURE,
    Plane,
    RestFilm,
    light_of,
    top_of,
    truncated,
    upper_median,
)
from tactograph.sdk import F4

Kind = Literal["one", "off", "mixed", "saturated", "covered", "unclear", "wrong size"]
BAND_COUNT = 6
"""Number of bands of rows, each with its own weights."""
MAX_REST_DEPARTURE = 0.01
"""Largest relative departure from the best-fitting sum of a cell that is surely at rest."""
REST_NOISE = 0.005
"""Relative departure of the film at rest from its pattern."""
BAND_QUANTILE = 0.4
"""Quantile of its cells by which a band is judged: more than half of it may be touched."""
MAX_PAIR_RESIDUAL = 0.4
"""Largest remaining share of a band's residual if a second LED explains it."""
CERTAINTY_SHARE = 0.3
"""Share of the expected difference by which others must be worse for an LED to be certain."""
MAX_DARK_LIGHT = 0.12
"""Share of the film's light below which a frame is dark."""
MAX_SATURATED_SHARE = 0.03
"""Share of pixels at full scale above which a frame is refused."""
MAX_OTHER_WEIGHT = 0.04
"""Weight of a second LED, or deficit of the first, above which a frame is mixed."""
MIN_REST_SHARE = 0.15
"""Smallest share of film at rest that permits a decision."""
MIN_LED_GAIN, MAX_LED_GAIN = 0.5, 1.8
"""Range of an LED's brightness, 1 as calibrated."""
FIT_ROUNDS = 4
"""Number of robust fits, each without the cells that the previous one did not explain."""


class Sight(NamedTuple):
    """The content of one frame."""

    kind: Kind
    led: int = 0
    """The LED whose pattern is closest; 0 unless `kind` is "one" or "mixed"."""
    gain: float = 0.0
    """Brightness of the LED, 1 as calibrated."""
    other: int = 0
    """Second LED of a mixed frame, 0 if none was lit."""
    share: float = 0.0
    """Share of the second LED in the light of a mixed frame."""


def see(frame: Plane, film: RestFilm, full: float = 0.0, light: F4 | None = None) -> Sight:
    """Determine which LED lit a frame, from its image alone.

    Parameters
    ----------
    frame : H x W, the raw frame
    film : the film at rest
    full : the camera's largest value; 0: that of the frame's type
    light : `light_of` the frame, if known
    """
    if frame.shape != film.size:
        return Sight("wrong size")
    if np.count_nonzero(frame >= top_of(frame, full)) > MAX_SATURATED_SHARE * frame.size:
        return Sight("saturated")
    light_above_dark = (light_of(frame, full) if light is None else light) - film.dark
    patterns = film.scale.reshape(len(film.scale), -1)
    ratio = light_above_dark.ravel() / patterns
    brightness = upper_median(ratio)
    if brightness.max() < MAX_DARK_LIGHT:
        return Sight("off")
    best, gain, certain, target = _closest(ratio, brightness, film)
    bands = [
        _fit(target[band], patterns[:, band], best, gain)
        for band in _bands(*light_above_dark.shape)
    ]
    mixed = [band.weights for band in bands if band.mixed]
    if mixed:
        weights = np.mean([band.weights for band in bands], axis=0)
        other = _another(mixed, best)
        share = float(weights[other - 1] / weights.sum()) if other else 0.0
        return Sight("mixed", best + 1, float(weights[best]), other, share)
    if np.mean([band.at_rest for band in bands]) < MIN_REST_SHARE:
        return Sight("covered")
    if not certain:
        return Sight("unclear")
    if not MIN_LED_GAIN < gain < MAX_LED_GAIN:
        return Sight("mixed", best + 1, gain)
    return Sight("one", best + 1, gain)


def _closest(ratio: F4, brightness: F4, film: RestFilm) -> tuple[int, float, bool, F4]:
    """The LED whose pattern is closest, its brightness, and whether no other is as close.

    The last value is the light relative to that LED's.  `ratio` is the light over all patterns.
    """
    gains = np.maximum(brightness, np.float32(1e-3))
    share: F4 = np.asarray(ratio / gains[:, None], np.float32)
    apart = truncated(share - 1)
    best = int(apart.mean(axis=1).argmin())
    rest = (apart[best] < np.float32(MAX_DEPARTURE**2)).astype(np.float32)
    added = apart @ rest
    # Expected departure from the other LEDs' patterns on the film at rest if this LED is right.
    expected = film.confusion[best] @ rest
    others = np.arange(len(ratio)) != best
    clear = added[others] - added[best] > CERTAINTY_SHARE * expected[others]
    return best, float(gains[best]), bool(clear.all() and rest.any()), share[best]


def _quantile(values: F4) -> float:
    place = int(BAND_QUANTILE * (values.size - 1))
    return float(np.partition(values, place)[place])


class _Band(NamedTuple):
    """A band of rows: its weights, whether it needs more than one LED, and its share at rest."""

    weights: NDArray[np.float64]
    mixed: bool
    at_rest: float


def _bands(rows: int, columns: int) -> list[slice]:
    """The cells of each band."""
    ends = np.linspace(0, rows, min(BAND_COUNT, rows) + 1).round().astype(int) * columns
    return [slice(first, last) for first, last in pairwise(ends.tolist())]


def _fit(target: F4, patterns: F4, best: int, gain: float) -> _Band:
    """Explain a band by one LED, and if that fails by two.

    Neither explains a touch.  So the question is not whether the film is at rest, but whether a
    second LED explains most of the band that one LED does not.  `target` is the band's light
    relative to the first LED's.
    """
    alone = np.abs(target - 1)
    single = np.zeros(len(patterns))
    single[best] = gain
    at_rest = float((alone < MAX_DEPARTURE).mean())
    unexplained = _quantile(alone)
    if unexplained < REST_NOISE:
        return _Band(single, False, at_rest)
    basis = patterns / (np.float32(gain) * patterns[best])
    fits = [_pair(basis, target, best, second) for second in range(len(basis)) if second != best]
    weights, off = min(fits, key=lambda fit: fit[1])
    others = np.delete(weights, best)
    sensible = weights.min() > -MAX_OTHER_WEIGHT * gain and weights.sum() < MAX_LED_GAIN * gain
    strays = max(others.max(), abs(weights[best] - gain)) > MAX_OTHER_WEIGHT * gain
    return _Band(
        weights, bool(sensible and strays and off < MAX_PAIR_RESIDUAL * unexplained), at_rest
    )


def _pair(basis: F4, target: F4, first: int, second: int) -> tuple[NDArray[np.float64], float]:
    """Explain a band by two LEDs: least squares that converges to the cells it explains.

    Returns
    -------
    The weights, and the `BAND_QUANTILE` of the residual.
    """
    two = basis[[first, second]]
    used = np.ones(target.size, np.float32)
    weights: NDArray[np.float64] = np.zeros(2)
    off = target
    for _ in range(FIT_ROUNDS):
        weighted = two * used
        normal = (weighted @ two.T).astype(np.float64)
        normal[np.diag_indices(2)] += 1e-6 * used.size
        weights[:] = np.linalg.solve(normal, (weighted @ target).astype(np.float64))
        off = np.abs(weights.astype(np.float32) @ two - target)
        used = (off < max(REST_NOISE, 1.5 * float(upper_median(off)))).astype(np.float32)
    shares = np.zeros(len(basis))
    shares[[first, second]] = weights
    return shares, _quantile(off)


def reach(light: F4, patterns: F4, led: int, before: int, after: int) -> float:
    """Difference between the shares of the next and the previous LED in a frame.

    An exposure that begins too early or ends too late contains a little light of one neighbour
    and none of the other.  Changes of the film since the calibration look like a little of both,
    and cancel.

    Parameters
    ----------
    light, patterns : cells of the frame, h x w, and `RestFilm.scale`
    led, before, after : the LED of the frame and its neighbours in the cycle, 0 for a dark one

    Returns
    -------
    Share of the light, positive for the next LED.
    """
    numbers = [led, *(other for other in dict.fromkeys((before, after)) if other not in (0, led))]
    scale = np.float32(1) / patterns[led - 1].ravel()
    basis = patterns[[number - 1 for number in numbers]].reshape(len(numbers), -1) * scale
    target = light.ravel() * scale
    off = np.abs(target / upper_median(target) - 1)
    weights = np.zeros(len(numbers))
    for limit in (MAX_DEPARTURE, MAX_REST_DEPARTURE, MAX_REST_DEPARTURE):
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
    return int(share.argmax()) + 1 if share.max() > MAX_OTHER_WEIGHT else 0
