"""Count and report the faults of a stream of frames."""

import logging
import math
import time
from collections import Counter
from collections.abc import Callable, Mapping

from tactograph.rings.live.nodes.camera.camera import Shot
from tactograph.sdk import LiveState, warn

LOGGER = logging.getLogger("tactograph")
REPEAT_S = 2.0
"""Seconds after which a continuing fault is reported again."""
SILENCE_S = 0.7
"""Seconds without a touch after which faults are reported at once, not with the next touch."""
PACE_WINDOW_S, MAX_PACE_ERROR = 2.0, 0.05
"""Seconds over which the camera's rate is measured, and its largest relative error."""

FAULT_LINES = {
    "mixed": "a frame shows LED {led} and another one, or LED {led} in some rows only: discarded",
    "saturated": "a frame is saturated: discarded; shorten the exposure or keep other light out",
    "covered": "a frame does not show the film: discarded; is the lens covered?",
    "doubled": "the camera delivered a frame twice: discarded",
    "dark": "a frame is dark: discarded",
    "burnt out": "LED {led} stays dark: going on without it; look at its wires",
    "swapped": "a frame shows LED {led} out of turn: discarded",
    "late": "a frame of LED {led} came late: discarded",
    "slipped": "camera and LED controller are out of step: matching them anew",
    "shifted": "camera and LEDs overlap: the LEDs' cycle is shifted",
    "changed": "the film looks otherwise than in the calibration; calibrate again",
    "brightness": "LED {led} is not as bright as calibrated and heights are off: calibrate again",
    "wrong size": "the camera delivers another size than the calibration's: opening it again",
    "lost": "frames are missing",
    "moved": "the light changes faster than the LEDs take turns: heights are smeared",
    "dropped": "frames come faster than they are reconstructed: the oldest are dropped",
    "camera lost": "the camera is gone: looking for it until it is back",
    "controller lost": "the LED controller is gone: looking for it until it is back",
    "controller reset": "the LED controller was reset: its cycle is started again",
}
"""One line of explanation for every fault."""


class FaultLog:
    """Counts frames and faults, and reports each fault in one line.

    Parameters
    ----------
    state : the counters
    rate
        Frames per second that the camera must deliver, because the LEDs change as often.
        None: any rate.
    explanations : one line of explanation for every fault
    """

    def __init__(
        self, state: LiveState, rate: float | None, explanations: Mapping[str, str] = FAULT_LINES
    ) -> None:
        self.state, self._rate, self._explanations = state, rate, explanations
        self._counted: Counter[str] = Counter()
        self._before: float | None = None
        self._pace: Shot | None = None
        self._waiting: dict[str, None] = {}  # in order
        self._reported_s: dict[str, float] = {}
        self._item = time.monotonic()

    def take(self, counted: Counter[str]) -> None:
        """Note the faults that others have counted since the last call."""
        for fault, times in (counted - self._counted).items():
            self.note(fault, times=times)
        self._counted = counted

    def note(self, fault: str, about: object = 0, times: int = 1, once: str | None = None) -> None:
        """Count a fault, and report it with the next touch; with `once`, that line only once."""
        self.state.faults[fault] += times
        explanation = self._explanations.get(fault, f"the LED controller: {fault}")
        self.add(once or explanation.format(led=about), again_s=math.inf if once else REPEAT_S)

    def add(self, line: str, *, again_s: float = REPEAT_S) -> None:
        """Report a line with the next touch, unless it was reported within `again_s`."""
        now = time.monotonic()
        if now - self._reported_s.get(line, -math.inf) >= again_s:
            self._waiting[line] = None

    def tell(self, *, with_item: bool, to: Callable[[str], None] = warn) -> None:
        """Report waiting lines: with a touch, by `to`, or at once if none comes."""
        now = time.monotonic()
        if with_item:
            self._item = now
        elif now - self._item < SILENCE_S:
            return
        for line in self._waiting:
            self._reported_s[line] = now
            if with_item:
                to(line)
            else:
                LOGGER.warning("warning: %s", line)
        self._waiting.clear()

    def count(self, shot: Shot) -> None:
        """Count a frame, and the frames missing before it."""
        self.state.frames += 1
        if self._rate is None:
            return
        if self._before is not None:
            missing = round((shot.time - self._before) * self._rate) - 1
            if missing > 0:
                self.note("lost", times=missing)
        self._before = shot.time
        self._check_pace(shot, self._rate)

    def restart(self) -> None:
        """Forget the time of the last frame, because the camera was reconnected."""
        self._before = self._pace = None

    def _check_pace(self, shot: Shot, pace: float) -> None:
        """Compare the camera's rate with the LEDs' every few seconds."""
        if self._pace is None:
            self._pace = shot
        since = shot.time - self._pace.time
        if since < PACE_WINDOW_S:
            return
        rate = (shot.number - self._pace.number) / since
        self._pace = shot
        if abs(rate / pace - 1) > MAX_PACE_ERROR:
            self.state.faults["wrong rate"] += 1
            delivered = f"the camera delivers {rate:.1f} frames per second"
            self.add(f"{delivered}, but the LEDs change {pace:g} times")
