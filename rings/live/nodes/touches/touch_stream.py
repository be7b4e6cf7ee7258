"""The stream of touches: match and assemble frames, count and report faults."""

import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from tactograph.rings.frames.assemble import Assembler, Refresh
from tactograph.rings.frames.live_frames import LiveFrames, RawFrame
from tactograph.rings.frames.rest_film import RestFilm, light_of
from tactograph.rings.live.nodes.camera.camera import Camera, Shot
from tactograph.rings.live.nodes.touches._match_frames import Matcher, Verdict
from tactograph.rings.live.nodes.touches.fault_log import FaultLog
from tactograph.rings.live.nodes.touches.sensor import Rig
from tactograph.sdk import Dark, LiveState, warn

MAX_WAITING_FRAMES = 64
"""Most frames that wait for their touch."""
MAX_BRIGHTNESS_CHANGE = 0.1
"""Change of an LED's brightness since the calibration above which heights are not trusted."""
REOPEN_S = 0.3
"""Time between two attempts to get the right image size from a camera."""
MIXED_CYCLES = 1.5
"""Number of cycles without a frame of a single LED after which the LEDs' cycle is shifted."""
EXPOSURE_SHARE = 0.6
"""Approximate exposure, as a share of the frame time."""
MAX_NEIGHBOUR_SHARE = 0.004
"""Mean share of a neighbouring LED in the frames above which the cycle is also shifted."""
MAX_SHIFTS = 4
"""Number of shifts after which an unchanged share is not a neighbour's light."""
START_MARGIN_STEPS, MIN_MARGIN_STEPS = 0.2, 0.03
"""Initial and smallest margin between an exposure and the next change of LED, in steps."""
CLEAN_CYCLES, MAX_SEARCH_CYCLES = 2, 12
"""Number of cycles on end without a fault after which the phase of camera and LEDs is found, and
the most that are waited for."""
PHASE_FAULTS = {"mixed", "late", "swapped", "slipped", "shifted", "brightness"}
"""Faults that are to be expected until it is found."""
SEARCH_MESSAGE = (
    "finding the phase of camera and LEDs: frames that show two LEDs are discarded meanwhile"
)


class TouchStream:
    """A stream of touches, which `_touch_with` makes of new frames, perhaps none."""

    _camera: Camera
    _log: FaultLog
    _connected: tuple[int, ...]
    _restart: Callable[[], None]
    _touch_with: Callable[[list[Shot]], LiveFrames | None]
    _reopened = 0.0

    def touches(
        self,
        timeout: float = 0.25,
        seconds: float | None = None,
        items: int | None = None,
        to: Callable[[str], None] = warn,
    ) -> Iterator[LiveFrames]:
        """Yield touches until the time, their number or a video file ends.

        Faults are reported by `to`, or after `timeout` seconds without a frame.
        """
        end = None if seconds is None else time.monotonic() + seconds
        while end is None or time.monotonic() < end:
            shots = self._camera.shots(timeout)
            touch = self._touch_with(shots)
            self._log.tell(with_item=touch is not None, to=to)
            if touch is not None:
                yield touch
            if items is not None and self._log.state.touches >= items:
                return
            if self._camera.ended and not shots:
                return

    def _supervise(
        self, faults: Counter[str], connected: tuple[int, ...], news: Iterable[str] = ()
    ) -> None:
        """Report faults, refused settings and news; after a reconnection, forget older frames."""
        self._log.take(faults)
        self._log.state.dropped = self._camera.faults["dropped"]
        for line in (*self._camera.refused, *news):
            self._log.add(line)
        self._camera.refused = []
        if connected != self._connected:
            self._connected = connected
            self._restart()

    def _reopen(self) -> None:
        """Open the camera again, unless that was just done."""
        if time.monotonic() - self._reopened > REOPEN_S:
            self._reopened = time.monotonic()
            self._camera.reopen()


@dataclass
class Stream(TouchStream):
    """Turns a sensor's frames into touches.

    Parameters
    ----------
    sensor : camera and LEDs; not closed here
    film, dark : the film at rest, and H x W with all LEDs off
    refresh, full, whole : as for `Assembler`
    motion_limit, skip_moving
        Change of the light within a cycle above which a touch counts as moved, and whether such
        touches are left out.
    state : the counters
    """

    sensor: Rig
    film: RestFilm
    dark: Dark
    refresh: Refresh = "rolling"
    full: float = 0.0
    whole: bool = False
    motion_limit: float = 0.1
    skip_moving: bool = False
    state: LiveState = field(default_factory=LiveState)

    def __post_init__(self) -> None:
        sensor, film = self.sensor, self.film
        self._camera = sensor.camera
        self._matcher = Matcher(film, sensor.cycle, sensor.rate, sensor.lamps.clock, self.full)
        self._assembler = Assembler(
            film, self.dark, sensor.cycle, sensor.rate, self.refresh, self.full, self.whole
        )
        self._log = FaultLog(self.state, sensor.rate)
        self._connected = sensor.camera.connections, sensor.lamps.starts
        self._overlaps: list[float] = []
        self._tried: deque[float] = deque(maxlen=MAX_SHIFTS)
        self._later: bool | None = None
        self._margin = START_MARGIN_STEPS
        self._search()
        # While no touch is due, as when all frames of an LED fail, the oldest are dropped.
        self._new: deque[RawFrame] = deque(maxlen=max(MAX_WAITING_FRAMES, 4 * len(sensor.cycle)))

    def _touch_with(self, shots: list[Shot]) -> LiveFrames | None:
        camera, lamps = self._camera, self.sensor.lamps
        faults = camera.faults + lamps.faults
        del faults["lost"]  # counted here by the frames' times
        self._supervise(faults, (camera.connections, lamps.starts), lamps.news())
        for shot in shots:
            self._take(shot)
        return self._touch()

    def _restart(self) -> None:
        self._matcher.restart()
        self._assembler.restart()
        self._log.restart()
        self._overlaps.clear()
        self._search()

    def _search(self) -> None:
        """Begin to find the phase of camera and LEDs."""
        self._clean, self._searched = 0, MAX_SEARCH_CYCLES * len(self.sensor.cycle)

    def _look_for_phase(self, *, is_clean: bool) -> None:
        """Note a frame; the search ends after enough clean ones, or in vain."""
        self._clean = self._clean + 1 if is_clean else 0
        is_found = self._clean >= CLEAN_CYCLES * len(self.sensor.cycle)
        self._searched = 0 if is_found else max(self._searched - 1, 0)

    def _note(self, fault: str, about: int = 0) -> None:
        """Count and report a fault; in one line those to be expected while the phase is found."""
        is_expected = fault in PHASE_FAULTS and self._searched
        self._log.note(fault, about, once=SEARCH_MESSAGE if is_expected else None)

    def _take(self, shot: Shot) -> None:
        """Match one frame; keep it, or count its fault."""
        self._log.count(shot)
        light = light_of(shot.data, self.full)
        verdict = self._matcher.match(shot.data, shot.time, light)
        if verdict.fault:
            self._note(verdict.fault, verdict.about)
        self._react(verdict)
        led, is_dimmed = verdict.led, abs(verdict.gain - 1) > MAX_BRIGHTNESS_CHANGE
        if led is not None and is_dimmed:
            self._note("brightness", led)
        is_lit_in_part = is_dimmed and self._searched
        self._look_for_phase(is_clean=led is not None and not verdict.fault and not is_dimmed)
        if led is not None and not is_lit_in_part:
            frame = RawFrame(shot.number, led, shot.time, shot.data)
            self._new.append(frame)
            self._assembler.add(frame, light)

    def _react(self, verdict: Verdict) -> None:
        """React to a fault."""
        if verdict.fault == "mixed":
            self._overlaps.append(self._reach(verdict))
        elif verdict.led:
            self._overlaps.clear()
            if abs(self._matcher.mean_reach) > MAX_NEIGHBOUR_SHARE:
                self._separate(self._matcher.mean_reach)
        if len(self._overlaps) > MIXED_CYCLES * len(self.sensor.cycle):
            self._separate(sum(self._overlaps) / len(self._overlaps))
        if verdict.fault == "slipped":
            self._assembler.restart()
        if verdict.fault == "wrong size":
            self._reopen()

    def _reach(self, verdict: Verdict) -> float:
        """The share of the exposure in the next LED's step; negative: in the previous one's."""
        cycle, led, other = self.sensor.cycle, verdict.about, verdict.other
        if led not in cycle or other not in cycle:
            return 0.0
        apart = (cycle.index(other) - cycle.index(led)) % len(cycle)
        return verdict.share * {1: 1, len(cycle) - 1: -1}.get(apart, 0)

    def _separate(self, reach: float) -> None:
        """Shift the LEDs' steps so that no exposure extends into a neighbouring step."""
        self._overlaps.clear()
        if self.sensor.lamps.clock is None:
            return
        self._tried.append(reach)
        if (
            len(self._tried) == MAX_SHIFTS
            and max(self._tried) - min(self._tried) < MAX_NEIGHBOUR_SHARE
        ):
            # Shifts change nothing, so the film itself differs from the calibration.
            self._note("changed")
            self._matcher.usual_reach += reach
            self._matcher.mean_reach = 0.0
            self._tried.clear()
            return
        self._note("shifted")
        later = reach >= 0
        if self._later not in (None, later):
            # The last shift went too far, so there is little time between two exposures.
            self._margin = max(self._margin / 2, MIN_MARGIN_STEPS)
        self._later = later
        steps = EXPOSURE_SHARE * abs(reach) + self._margin
        self.sensor.lamps.shift(steps if later else -steps)

    def _touch(self) -> LiveFrames | None:
        """The touch that is due; None if there is none, or it moves too fast."""
        if not self._assembler.due:
            return None
        motion = self._assembler.motion
        if motion > self.motion_limit:
            self._log.note("moved")
            if self.skip_moving:
                return None
        newest = self._assembler.newest
        image, new = self._assembler.take(), [*self._new]
        self._new.clear()
        self.state.motion = motion
        truth = self.sensor.truth(newest.time)
        return LiveFrames.counted(image, newest.time, new, self.state, truth)
