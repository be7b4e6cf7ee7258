"""Match a stream of frames to the LEDs of a cycle, by their images and the controller's clock."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.rings.frames.rest_film import Plane, RestFilm, light_of
from tactograph.rings.live.nodes.touches.led_in_frame import Sight, reach, see
from tactograph.sdk import F4

Clock = Callable[[float], int | None]
"""The LED that was lit at a time of time.monotonic(), 0 for none; None if unknown."""
MIN_REACH = 0.012
"""Share of a neighbour in the cycle above which a frame is mixed."""
REACH_SHARE = 0.1
"""Weight of a new frame in the running mean of that share, which is more accurate."""
STRANGE_CYCLES = 2
"""Number of cycles without a usable frame after which the ambient light is measured again."""
SLIPPED_FRAMES = 3
"""Number of consecutive frames out of turn after which the cycle counts as slipped."""
DARK_CYCLES = 3
"""Cycles that an LED must stay dark, while others are lit, to count as burnt out."""
PHASE_BINS = 8
"""Number of camera delays that are distinguished per step of the cycle."""
MEMORY_SHARE = 0.9
"""Factor by which the delays' scores decay with every frame."""


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
    """Second LED of a mixed frame, 0 for none, and its share of the light."""
    gain: float = 1.0
    """The LED's brightness, 1 as calibrated."""


@dataclass
class Matcher:
    """Matches a stream of frames to the LEDs of a cycle.

    The image is evaluated first.  If the controller's clock is known, both must agree; the delay
    of the camera's times against that clock is learnt from the frames themselves.

    Parameters
    ----------
    film : the film at rest
    cycle : the LEDs in the order of the cycle, 0 for the ambient step
    rate : frames per second
    clock : the controller's cycle; None: the image alone decides
    full : the camera's largest value; 0: that of the frame's type
    burnt : LEDs that stay dark
    usual_reach : the `reach` of correct frames: 0 unless the film has changed since the calibration
    mean_reach : running mean of the excess over it
    """

    film: RestFilm
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
    _has_ambient: bool = False

    def __post_init__(self) -> None:
        self._delay = _Delay(self.cycle, self.rate)

    def restart(self) -> None:
        """Forget the cycle's phase, because the camera or the controller was reconnected."""
        self._delay = _Delay(self.cycle, self.rate)
        self._last = self._before = None
        self._first, self._has_ambient = [], False
        self.mean_reach = 0.0
        self._disagreed = 0

    def match(self, data: Plane, time: float, light: F4 | None = None) -> Verdict:
        """Determine which LED a frame belongs to, or why it is discarded.

        Parameters
        ----------
        data : H x W, the frame
        time : the end of its exposure as reported by the camera, in s of time.monotonic()
        light : `light_of` the frame, if known
        """
        if light is None:
            light = light_of(data, self.full)
        if 0 in self.cycle and not self._has_ambient and data.shape == self.film.size:
            return self._learn_ambient(light)
        verdict = self._verdict(data, light, see(data, self.film, self.full, light), time)
        self._discarded = self._discarded + 1 if verdict.led is None else 0
        if self._discarded > STRANGE_CYCLES * len(self.cycle):
            self._discarded, self._has_ambient = 0, False
        return verdict

    def _verdict(self, data: Plane, light: F4, sight: Sight, time: float) -> Verdict:
        if sight.kind in ("wrong size", "saturated"):
            return Verdict(None, sight.kind)
        if sight.kind != "off" and self._is_doubled(data):
            return Verdict(None, "doubled")
        due = self._due(time)
        if sight.kind == "off":
            return self._off(light, due, time)
        if sight.kind == "mixed":
            return Verdict(None, "mixed", sight.led, sight.other, sight.share)
        if sight.kind == "covered" or (sight.kind == "unclear" and not due):
            return Verdict(None, "covered")
        led = sight.led if sight.kind == "one" else due
        assert led is not None
        overlap = 0.0
        if sight.kind == "one":  # the excess over the usual reach
            place, film = self.cycle.index(led), self.film
            neighbours = self.cycle[place - 1], self.cycle[(place + 1) % len(self.cycle)]
            overlap = reach(light - film.dark, film.scale, led, *neighbours) - self.usual_reach
            if abs(overlap) > MIN_REACH:
                return Verdict(None, "mixed", led, neighbours[overlap > 0], abs(overlap))
        self.mean_reach += REACH_SHARE * (overlap - self.mean_reach)
        verdict = self._agreed(led, due, time, certain=sight.kind == "one")
        return verdict._replace(gain=sight.gain) if sight.kind == "one" else verdict

    def _learn_ambient(self, light: F4) -> Verdict:
        """Take the darkest frame of the first cycle as that of the ambient step."""
        self._first.append(light)
        if len(self._first) > len(self.cycle):
            darkest = min(self._first, key=lambda light: float(np.median(light)))
            self.film = replace(self.film, dark=darkest)
            self._first, self._has_ambient = [], True
        return Verdict(None)

    def _agreed(self, led: int, due: int | None, time: float, *, certain: bool) -> Verdict:
        """Compare the image's LED with the one that was due."""
        if certain and self.clock is not None:
            self._delay.learn(led, time, self.clock)
        if due is not None and led != due and self.clock is not None:
            self._disagreed += 1
            if self._disagreed >= SLIPPED_FRAMES:
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

    def _off(self, light: F4, due: int | None, time: float) -> Verdict:
        """Judge a dark frame: the ambient step, a failing LED, or a covered lens."""
        if due is None:
            return Verdict(None, "dark")
        if due == 0:
            self._last = time, 0
            self.film = replace(self.film, dark=light)
            return Verdict(0)
        recent = 2 * len(self.cycle) / self.rate
        shining = [led for led, last in self._lit.items() if led != due and time - last < recent]
        if len(shining) < 3:
            return Verdict(None, "covered")
        self._dark[due] += 1
        self._last = time, due
        if self._dark[due] < DARK_CYCLES:
            return Verdict(None, "dark", due)
        self.burnt.add(due)
        return Verdict(due, "burnt out", due)

    def _due(self, time: float) -> int | None:
        """The LED whose turn it is: by the clock if there is one, else by the cycle's order."""
        if self.clock is not None:
            return self._delay.due(time, self.clock)
        if self._last is None or time - self._last[0] > 2 * len(self.cycle) / self.rate:
            return None
        steps = round((time - self._last[0]) * self.rate)
        return self.cycle[(self.cycle.index(self._last[1]) + steps) % len(self.cycle)]

    def _is_doubled(self, data: NDArray[np.generic]) -> bool:
        """Tell if a frame repeats the previous one: noise never repeats."""
        sample = data[::5, ::3]
        same = self._before is not None and np.array_equal(sample, self._before)
        self._before = sample.copy()
        return same


class _Delay:
    """Delay of the camera's times against the controller's clock, modulo a cycle.

    Every frame votes for the delays that would explain its LED.  The result is the middle of the
    longest run of the best ones.
    """

    def __init__(self, cycle: tuple[int, ...], rate: float) -> None:
        self._step = 1 / (PHASE_BINS * rate)
        self._scores = np.zeros(PHASE_BINS * len(cycle))
        self._votes = 0
        self._needed = len(cycle)

    def learn(self, led: int, time: float, clock: Clock) -> None:
        lit = [clock(time - i * self._step) for i in range(len(self._scores))]
        if any(each is not None for each in lit):
            self._scores *= MEMORY_SHARE
            self._scores += [each == led for each in lit]
            self._votes += 1

    def due(self, time: float, clock: Clock) -> int | None:
        """The LED by the clock; None until enough frames have voted."""
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
    runs = ([*run] for is_set, run in groupby(range(count), turned.item) if is_set)
    longest = max(runs, key=len)
    return (start + (longest[0] + longest[-1]) / 2) % count
