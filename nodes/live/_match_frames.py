"""Which LED a frame was exposed with: told by its image, checked against the controller's clock.

The film at rest looks different under every LED, and the calibration knows how.  What of the
film is untouched in a frame is therefore a sum of the flat frames, one of which has weight 1
and all others 0; a rolling shutter that saw two LEDs shows other weights in other rows.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, Dark, Light

Plane = NDArray[np.uint8] | NDArray[np.uint16]
Clock = Callable[[float], int | None]
"""The LED that was lit at a moment of time.monotonic(), 0 for none; None: not known."""
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
LEAST_REACH = 0.012
"""Share of a neighbour in the cycle above which a frame is mixed."""
REACH_SHARE = 0.1
"""Weight of a new frame in the mean of that share, which is known better."""
LEAST_AT_REST = 0.15
"""Share of the film at rest below which nothing can be said at all."""
DIMMEST, BRIGHTEST = 0.5, 1.8
"""Range of an LED's brightness, 1 as calibrated."""
FITS = 4
"""Robust fits, each leaving out what the one before did not explain."""
STRANGE_CYCLES = 2
"""After so many cycles without a usable frame the ambient light is looked for again."""
SLIPPED = 3
"""So many frames out of turn in a row are no swap any more."""
DARK_CYCLES = 3
"""An LED that stays dark so often while others light is taken to be burnt out."""
PHASES = 8
"""Delays of the camera that are told apart, in parts of a step of the cycle."""
FORGET = 0.9
"""What remains of a delay's score with every frame."""


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


class Verdict(NamedTuple):
    """The LED of a frame (0: all off), or None with the fault for which it is discarded.

    None without a fault: not enough has been seen yet.
    """

    led: int | None
    fault: str = ""
    about: int = 0
    """The LED that the fault is about; 0 for none."""
    other: int = 0
    share: float = 0.0
    """Of a mixed frame: the second LED, 0 for none, and its share of the light."""
    gain: float = 1.0
    """The LED's brightness, 1 as calibrated."""


@dataclass
class Matcher:
    """Matches a stream of frames to the LEDs of a cycle.

    The image is asked first.  Where the controller's clock is known, both have to agree; how
    late the camera's times are against that clock is learnt from the frames themselves.

    Parameters
    ----------
    film
        What the film at rest looks like.
    cycle
        The LEDs in the order of the cycle, 0 for the ambient step.
    rate
        Frames per second.
    clock
        The controller's cycle; None: the image alone decides.
    full
        The camera's largest value; 0: that of the frame's type.
    burnt
        LEDs that stay dark.
    usual_reach
        The `reach` of frames that are in order: 0 unless the film looks otherwise than it did.
    mean_reach
        Mean of what the last frames had above that.
    """

    film: Film
    cycle: tuple[int, ...]
    rate: float
    clock: Clock | None = None
    full: float = 0.0
    burnt: set[int] = field(default_factory=set)
    usual_reach: float = 0.0
    mean_reach: float = field(default=0.0, init=False)
    _delay: _Delay = field(init=False)
    _last: tuple[float, int] | None = None
    _before: NDArray[np.generic] | None = None
    _dark: Counter[int] = field(default_factory=Counter)
    _lit: dict[int, float] = field(default_factory=dict)
    _disagreed: int = 0
    _discarded: int = 0
    _first: list[F4] = field(default_factory=list)
    _ambient_known: bool = False

    def __post_init__(self) -> None:
        self._delay = _Delay(self.cycle, self.rate)

    def restart(self) -> None:
        """Forget the cycle's phase: the camera or the controller was connected again."""
        self._delay = _Delay(self.cycle, self.rate)
        self._last = self._before = None
        self._first, self._ambient_known = [], False
        self.mean_reach = 0.0
        self._disagreed = 0

    def match(self, data: Plane, time: float) -> Verdict:
        """Say which LED a frame belongs to, or why it is discarded.

        Parameters
        ----------
        data
            H x W, the frame.
        time
            The end of its exposure as the camera told it, s of time.monotonic().
        """
        if 0 in self.cycle and not self._ambient_known and data.shape == self.film.size:
            return self._learn_ambient(data)
        verdict = self._verdict(data, see(data, self.film, self.full), time)
        self._discarded = self._discarded + 1 if verdict.led is None else 0
        if self._discarded > STRANGE_CYCLES * len(self.cycle):
            self._discarded, self._ambient_known = 0, False
        return verdict

    def _verdict(self, data: Plane, sight: Sight, time: float) -> Verdict:
        if sight.kind in ("wrong size", "saturated"):
            return Verdict(None, sight.kind)
        if sight.kind != "off" and self._is_doubled(data):
            return Verdict(None, "doubled")
        due = self._due(time)
        if sight.kind == "off":
            return self._off(data, due, time)
        if sight.kind == "mixed":
            return Verdict(None, "mixed", sight.led, sight.other, sight.share)
        if sight.kind == "covered" or (sight.kind == "unclear" and not due):
            return Verdict(None, "covered")
        led = sight.led if sight.kind == "one" else due
        assert led is not None
        overlap = self._overlap(data, led) if sight.kind == "one" else 0.0
        if abs(overlap) > LEAST_REACH:
            other = self._neighbours(led)[overlap > 0]
            return Verdict(None, "mixed", led, other, abs(overlap))
        self.mean_reach += REACH_SHARE * (overlap - self.mean_reach)
        verdict = self._agreed(led, due, time, certain=sight.kind == "one")
        return verdict._replace(gain=sight.gain) if sight.kind == "one" else verdict

    def _overlap(self, data: Plane, led: int) -> float:
        """`reach` of a frame, above what is usual."""
        light = self._light(data) - self.film.dark
        patterns = np.maximum(self.film.patterns, np.float32(FAINTEST))
        return reach(light, patterns, led, *self._neighbours(led)) - self.usual_reach

    def _neighbours(self, led: int) -> tuple[int, int]:
        place = self.cycle.index(led)
        return self.cycle[place - 1], self.cycle[(place + 1) % len(self.cycle)]

    def _learn_ambient(self, data: Plane) -> Verdict:
        """Take the darkest frame of the first cycle for the ambient step's."""
        self._first.append(self._light(data))
        if len(self._first) > len(self.cycle):
            darkest = min(self._first, key=lambda light: float(np.median(light)))
            self.film = replace(self.film, dark=darkest)
            self._first, self._ambient_known = [], True
        return Verdict(None)

    def _light(self, data: Plane) -> F4:
        return cells(data) / np.float32(self.full or np.iinfo(data.dtype).max)

    def _agreed(self, led: int, due: int | None, time: float, *, certain: bool) -> Verdict:
        """Compare the image's LED with the one that was due."""
        if certain and self.clock is not None:
            self._delay.learn(led, time, self.clock)
        if due is not None and led != due and self.clock is not None:
            self._disagreed += 1
            if self._disagreed >= SLIPPED:
                self.restart()
                return Verdict(None, "slipped", led)
            before = self.cycle[self.cycle.index(due) - 1]
            return Verdict(None, "late" if led == before else "swapped", led)
        self._disagreed = 0
        self._dark[led] = 0
        self.burnt.discard(led)
        self._lit[led] = time
        self._last = time, led
        return Verdict(led)

    def _off(self, data: Plane, due: int | None, time: float) -> Verdict:
        """A dark frame: the ambient step, an LED that fails, or a covered lens."""
        if due is None:
            return Verdict(None, "dark")
        if due == 0:
            self._last = time, 0
            self.film = replace(self.film, dark=self._light(data))
            return Verdict(0)
        recent = 2 * len(self.cycle) / self.rate
        shining = [led for led, seen in self._lit.items() if led != due and time - seen < recent]
        if len(shining) < 3:
            return Verdict(None, "covered")
        self._dark[due] += 1
        self._last = time, due
        if self._dark[due] < DARK_CYCLES:
            return Verdict(None, "dark", due)
        self.burnt.add(due)
        return Verdict(due, "burnt out", due)

    def _due(self, time: float) -> int | None:
        """The LED whose turn it is: by the clock if there is one, else by order."""
        if self.clock is not None:
            return self._delay.due(time, self.clock)
        if self._last is None or time - self._last[0] > 2 * len(self.cycle) / self.rate:
            return None
        steps = round((time - self._last[0]) * self.rate)
        return self.cycle[(self.cycle.index(self._last[1]) + steps) % len(self.cycle)]

    def _is_doubled(self, data: NDArray[np.generic]) -> bool:
        """Whether it is the frame before once more: noise never repeats."""
        sample = data[::5, ::3]
        same = self._before is not None and np.array_equal(sample, self._before)
        self._before = sample.copy()
        return same


class _Delay:
    """How late the camera's times are against the controller's clock, modulo a cycle.

    Every frame votes for the delays that would explain its LED; the middle of the longest run
    of the best ones is taken.
    """

    def __init__(self, cycle: tuple[int, ...], rate: float) -> None:
        self._step = 1 / (PHASES * rate)
        self._scores = np.zeros(PHASES * len(cycle))
        self._votes = 0
        self._needed = len(cycle)

    def learn(self, led: int, time: float, clock: Clock) -> None:
        lit = [clock(time - i * self._step) for i in range(len(self._scores))]
        if any(each is not None for each in lit):
            self._scores *= FORGET
            self._scores += [each == led for each in lit]
            self._votes += 1

    def due(self, time: float, clock: Clock) -> int | None:
        """The LED that the clock says; None before enough frames have voted."""
        if self._votes < self._needed:
            return None
        return clock(time - self.seconds)

    @property
    def seconds(self) -> float:
        best = self._scores > 0.95 * self._scores.max()
        return _middle_of_longest_run(best) * self._step


def _middle_of_longest_run(flags: NDArray[np.bool_]) -> float:
    """Index of the middle of the longest run of True on a ring."""
    count = len(flags)
    if flags.all():
        return 0.0
    start = int(np.flatnonzero(~flags)[0])
    turned = np.roll(flags, -start)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], turned, [False]]).astype(np.int8)))
    starts, ends = edges[::2], edges[1::2]
    longest = int((ends - starts).argmax())
    middle = (starts[longest] + ends[longest] - 1) / 2
    return math.fmod(start + float(middle), count)
