"""The stream of touches: frames are matched and assembled, faults counted and reported."""

from __future__ import annotations

import logging
import time
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

from tactograph.graph import warn
from tactograph.nodes.live._assemble import Assembler, Refresh
from tactograph.nodes.live._camera import Shot
from tactograph.nodes.live._frames import LiveState, RawFrame, Touch
from tactograph.nodes.live._match_frames import Matcher, Verdict
from tactograph.nodes.live._sensor import Sensor

LOG = logging.getLogger("tactograph")
AGAIN_S = 2.0
"""A fault that goes on is reported again after so many seconds."""
SILENCE_S = 0.7
"""Without a touch for so long, faults are reported at once instead of with the next touch."""
KEPT = 64
"""Frames that wait for a touch to go with, at most."""
PACE_S, MOST_OFF_PACE = 2.0, 0.05
"""The camera's rate is measured over so many seconds, and may be off by this share."""
MOST_DIMMED = 0.1
"""Change of an LED's brightness since the calibration above which heights are not trusted."""
REOPEN_S = 0.3
"""Time between two attempts to get the right size out of a camera."""
MIXED_CYCLES = 1.5
"""After so many cycles in which no LED is seen alone, the LEDs' cycle is shifted."""
EXPOSED = 0.6
"""The exposure as a share of the frame time, roughly."""
CREEP = 0.004
"""A mean share of a neighbour in the frames above which the cycle is shifted, too."""
ATTEMPTS = 4
"""A share that stays the same through so many shifts is none of a neighbour's light."""
MARGIN, LEAST_MARGIN = 0.2, 0.03
"""So much of a step lies between an exposure and the next change of LED, at first, at least."""

SAYS = {
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
"""What every fault is, in one line."""


@dataclass
class Stream:
    """Turns a sensor's frames into touches.

    Parameters
    ----------
    sensor
        Camera, LEDs and film; not closed here.
    refresh, full
        As for `Assembler`.
    motion_limit, skip_moving
        Change of the light within a cycle above which a touch counts as moved, and whether
        it is left out then.
    state
        What is counted.
    """

    sensor: Sensor
    refresh: Refresh = "rolling"
    full: float = 0.0
    motion_limit: float = 0.1
    skip_moving: bool = False
    state: LiveState = field(default_factory=LiveState)

    def __post_init__(self) -> None:
        sensor = self.sensor
        self._matcher = Matcher(
            sensor.film, sensor.cycle, sensor.rate, sensor.lamps.clock, self.full
        )
        self._assembler = Assembler(
            sensor.film, sensor.dark, sensor.cycle, sensor.rate, self.refresh, self.full
        )
        self._teller = _Teller()
        self._counted: Counter[str] = Counter()
        self._connected = sensor.camera.connections, sensor.lamps.starts
        self._before: float | None = None
        self._overlaps: list[float] = []
        self._tried: deque[float] = deque(maxlen=ATTEMPTS)
        self._later: bool | None = None
        self._margin = MARGIN
        self._reopened = 0.0
        self._pace: Shot | None = None
        # While no touch is due, as with an LED whose frames all fail, the oldest are let go.
        self._new: deque[RawFrame] = deque(maxlen=max(KEPT, 4 * len(sensor.cycle)))

    def touches(
        self, timeout: float = 0.25, seconds: float | None = None, items: int | None = None
    ) -> Iterator[Touch]:
        """Yield touches until the time, their number or a video file is at its end."""
        end = None if seconds is None else time.monotonic() + seconds
        camera = self.sensor.camera
        while end is None or time.monotonic() < end:
            shots = camera.shots(timeout)
            self._supervise()
            for shot in shots:
                self._take(shot)
            touch = self._touch()
            self._teller.tell(with_item=touch is not None)
            if touch is not None:
                yield touch
            if items is not None and self.state.touches >= items:
                return
            if camera.ended and not shots:
                return

    def _supervise(self) -> None:
        """Count what camera and controller went through; forget frames from before it."""
        camera, lamps = self.sensor.camera, self.sensor.lamps
        counted = camera.faults + lamps.faults
        for fault, times in (counted - self._counted).items():
            self._note(fault, times=times)
        self._counted = counted
        self.state.dropped = camera.faults["dropped"]
        for line in (*camera.refused, *lamps.news()):
            self._teller.add(line)
        camera.refused = []
        connected = camera.connections, lamps.starts
        if connected != self._connected:
            self._connected = connected
            self._restart()

    def _restart(self) -> None:
        self._matcher.restart()
        self._assembler.restart()
        self._before = self._pace = None
        self._overlaps.clear()

    def _take(self, shot: Shot) -> None:
        """Match one frame; keep it, or count why not."""
        self.state.frames += 1
        self._count_gap(shot.time)
        self._check_pace(shot)
        verdict = self._matcher.match(shot.data, shot.time)
        if verdict.fault:
            self._note(verdict.fault, verdict.about)
        self._react(verdict)
        if verdict.led is not None:
            if abs(verdict.gain - 1) > MOST_DIMMED:
                self._note("brightness", verdict.led)
            frame = RawFrame(shot.number, verdict.led, shot.time, shot.data)
            self._new.append(frame)
            self._assembler.add(frame)

    def _react(self, verdict: Verdict) -> None:
        """Do what can be done about a fault."""
        if verdict.fault == "mixed":
            self._overlaps.append(self._reach(verdict))
        elif verdict.led:
            self._overlaps.clear()
            if abs(self._matcher.mean_reach) > CREEP:
                self._separate(self._matcher.mean_reach)
        if len(self._overlaps) > MIXED_CYCLES * len(self.sensor.cycle):
            self._separate(sum(self._overlaps) / len(self._overlaps))
        if verdict.fault == "slipped":
            self._assembler.restart()
        if verdict.fault == "wrong size" and time.monotonic() - self._reopened > REOPEN_S:
            self._reopened = time.monotonic()
            self.sensor.camera.reopen()

    def _reach(self, verdict: Verdict) -> float:
        """The share of the exposure that lies in the LED's next step, negative: the last one."""
        cycle, led, other = self.sensor.cycle, verdict.about, verdict.other
        if led not in cycle or other not in cycle:
            return 0.0
        apart = (cycle.index(other) - cycle.index(led)) % len(cycle)
        return verdict.share * {1: 1, len(cycle) - 1: -1}.get(apart, 0)

    def _separate(self, reach: float) -> None:
        """Move the LEDs' steps to where no exposure crosses from one into the next."""
        self._overlaps.clear()
        if self.sensor.lamps.clock is None:
            return
        self._tried.append(reach)
        if len(self._tried) == ATTEMPTS and max(self._tried) - min(self._tried) < CREEP:
            # Shifts change nothing: it is the film that looks otherwise than calibrated.
            self._note("changed")
            self._matcher.usual_reach += reach
            self._matcher.mean_reach = 0.0
            self._tried.clear()
            return
        self._note("shifted")
        later = reach >= 0
        if self._later not in (None, later):
            # It went too far the last time: little time is left between two exposures.
            self._margin = max(self._margin / 2, LEAST_MARGIN)
        self._later = later
        steps = EXPOSED * abs(reach) + self._margin
        self.sensor.lamps.shift(steps if later else -steps)

    def _count_gap(self, moment: float) -> None:
        if self._before is not None:
            missing = round((moment - self._before) * self.sensor.rate) - 1
            if missing > 0:
                self._note("lost", times=missing)
        self._before = moment

    def _check_pace(self, shot: Shot) -> None:
        """Compare the camera's rate with the LEDs' every few seconds."""
        if self._pace is None:
            self._pace = shot
        since = shot.time - self._pace.time
        if since < PACE_S:
            return
        rate = (shot.number - self._pace.number) / since
        self._pace = shot
        if abs(rate / self.sensor.rate - 1) > MOST_OFF_PACE:
            self.state.faults["wrong rate"] += 1
            self._teller.add(
                f"the camera delivers {rate:.1f} frames per second, "
                f"but the LEDs change {self.sensor.rate:g} times"
            )

    def _touch(self) -> Touch | None:
        """The touch that is due, unless it moves too fast."""
        if not self._assembler.due:
            return None
        motion = self._assembler.motion
        if motion > self.motion_limit:
            self._note("moved")
            if self.skip_moving:
                return None
        newest = self._assembler.newest
        image, new = self._assembler.take(), [*self._new]
        self._new.clear()
        self.state.touches += 1
        self.state.motion = motion
        state = replace(self.state, faults=Counter(self.state.faults))
        truth = self.sensor.truth(newest.time)
        return Touch(image, f"{self.state.touches:06}", newest.time, new, state, truth)

    def _note(self, fault: str, led: int = 0, times: int = 1) -> None:
        self.state.faults[fault] += times
        says = SAYS.get(fault, f"the LED controller: {fault}")
        self._teller.add(says.format(led=led))


class _Teller:
    """Says each fault in one line: with the next touch, or at once if none comes."""

    def __init__(self) -> None:
        self._waiting: dict[str, float] = {}
        self._said: dict[str, float] = {}
        self._item = time.monotonic()

    def add(self, line: str) -> None:
        now = time.monotonic()
        if now - self._said.get(line, -AGAIN_S) >= AGAIN_S:
            self._waiting.setdefault(line, now)

    def tell(self, *, with_item: bool) -> None:
        now = time.monotonic()
        if with_item:
            self._item = now
        elif now - self._item < SILENCE_S:
            return
        for line in self._waiting:
            self._said[line] = now
            if with_item:
                warn(line)
            else:
                LOG.warning("warning: %s", line)
        self._waiting.clear()
