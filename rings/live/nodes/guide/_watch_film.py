"""Watch a person at the sensor: detect when the film is at rest and when it is pressed."""

import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np

from tactograph.rings.frames.live_frames import LiveFrames
from tactograph.rings.frames.rest_film import MIN_REST_LIGHT, RestFilm, cells, top_of
from tactograph.rings.live.nodes.camera.camera import Camera
from tactograph.rings.live.nodes.touches.colour_stream import ColourStream
from tactograph.rings.live.nodes.touches.fault_log import FAULT_LINES
from tactograph.rings.live.nodes.touches.sensor import Rig
from tactograph.rings.live.nodes.touches.touch_stream import Stream
from tactograph.sdk import F4, Dark, InputError, Light

SETTLE_S = 0.25
"""Time for which a camera may deliver frames from before an LED was switched."""
MEAN_FRAMES = 10
"""Frames of the untouched film per LED."""
MIN_LED_LIGHT = 0.02
"""Mean light of an LED, as a share of full scale, below which it cannot be used."""
CHANGE_QUANTILE = 0.998
"""Quantile of the cells by which changes are judged, to ignore the noisiest."""
MIN_MOTION = 0.05
"""Change of the light, 1 on the film at rest, above which something moves."""
MAX_REST_CHANGE, MIN_PRESS_CHANGE = 0.08, 0.2
"""Departure from the untouched film below which it is at rest, and above which it is pressed."""
REMINDER_S = 15.0
"""Time after which a request is repeated."""
POLL_S = 0.25
HARMLESS_FAULTS = ("lost", "dropped", "moved")
"""Faults that do not matter, because presses are held still and frames may be missed meanwhile."""

State = Literal["untouched", "pressed", "between"]
Ball = TypeVar("Ball")


def tell(line: str) -> None:
    """Print a line for the person at the sensor, at once."""
    print(line, file=sys.stderr, flush=True)


def new_folder(calibration: Path) -> Path:
    """The folder for the presses of a calibration: ``cal_presses`` for ``cal.npz``.

    Raises
    ------
    InputError
        If the folder exists already.
    """
    folder = calibration.with_name(f"{calibration.stem}_presses")
    if folder.exists():
        raise InputError(
            f"{folder}: holds presses already; move it away, or give the calibration another name"
        )
    return folder


def film_at_rest(rig: Rig, full: float, patience_s: float) -> tuple[Light, Dark]:
    """Capture the untouched film under one LED after the other, and with all LEDs off.

    The LEDs are held one by one, so frames need not be matched to them.  `full` is the camera's
    largest value, as for `top_of`.

    Returns
    -------
    K x H x W and H x W, means of some frames, fractions of full scale.

    Raises
    ------
    InputError
        If an LED gives no light; if something moves for longer than `patience_s`.
    """
    leds = sorted(led for led in rig.cycle if led)

    def means() -> Iterator[F4 | None]:
        # The first LED is captured again at the end, to detect a touch in between.
        for led in (*leds, 0, leds[0]):
            rig.lamps.hold(led)
            yield _mean_of_frames(rig.camera, time.monotonic() + SETTLE_S, full)

    *image, dark, _ = _at_rest(means, patience_s)
    for led, plane in zip(leds, image, strict=True):
        if float((plane - dark).mean()) < MIN_LED_LIGHT:
            raise InputError(
                f"LED {led} gives no light on the film; look at its wires and at the "
                "exposure ('tactograph run check_leds' lights each in turn)"
            )
    return np.stack(image), dark


def colours_at_rest(camera: Camera, full: float, patience_s: float) -> F4:
    """Capture the untouched film of a one-shot sensor: H x W x 3 in the driver's order.

    `full` is the camera's largest value, as for `top_of`.

    Raises
    ------
    InputError
        If a colour gives no light; if something moves for longer than `patience_s`.
    """

    def means() -> Iterator[F4 | None]:
        for _ in range(2):
            yield _mean_of_frames(camera, time.monotonic(), full)

    one, later = _at_rest(means, patience_s)
    for colour, plane in zip(("blue", "green", "red"), np.moveaxis(one, -1, 0), strict=True):
        if float(plane.mean()) < MIN_LED_LIGHT:
            raise InputError(
                f"{colour} gives no light on the film; look at the sensor's LEDs and the exposure"
            )
    return (one + later) * np.float32(0.5)


def _at_rest(means: Callable[[], Iterable[F4 | None]], patience_s: float) -> list[F4]:
    """Capture again and again until the last of the images shows what the first does."""
    end = time.monotonic() + patience_s
    while time.monotonic() < end:
        images = [*means()]
        still = [image for image in images if image is not None]
        if len(still) == len(images):
            first, last = cells(still[0]), cells(still[-1])
            if _change(first, last, first) < MIN_MOTION:
                return still
    raise InputError(
        f"the film does not come to rest within {patience_s:g} s; take everything off it, keep "
        "other light out, and turn the camera's automatic exposure off"
    )


def _mean_of_frames(camera: Camera, settled: float, full: float) -> F4 | None:
    """The mean of some frames from `settled` on; None if the light changes meanwhile."""
    total: F4 | None = None
    first: F4 | None = None
    count = 0
    while count < MEAN_FRAMES:
        shots = camera.shots(POLL_S)
        if not shots and time.monotonic() - settled > MEAN_FRAMES * POLL_S:
            raise InputError("the camera delivers no frames any more; look at its cable")
        for shot in shots:
            if shot.time < settled:
                continue
            plane = shot.data * np.float32(1 / top_of(shot.data, full))
            light = cells(plane)
            if first is None or total is None:
                first, total = light, np.zeros_like(plane)
            if _change(light, first, first) > MIN_MOTION:
                return None
            total += plane
            count += 1
    assert total is not None
    return total / np.float32(count)


def _change(one: F4, other: F4, rest: F4) -> float:
    """Difference of light, 1 on the film at rest, without the noisiest cells."""
    share = np.abs(one - other) / np.maximum(rest, np.float32(MIN_REST_LIGHT))
    return float(np.quantile(share, CHANGE_QUANTILE))


class Watch:
    """Watches touches until the person at the sensor has made the requested one.

    Parameters
    ----------
    film : the untouched film
    stream : touches, one per cycle of the LEDs, or per colour frame
    still_s : time for which nothing may change
    patience_s : longest time to wait
    """

    def __init__(
        self, film: RestFilm, stream: Stream | ColourStream, still_s: float, patience_s: float
    ) -> None:
        self._film, self._stream = film, stream
        self._still, self._patience = still_s, patience_s
        self._recent: deque[tuple[float, F4]] = deque()
        self._reported = {FAULT_LINES[fault] for fault in HARMLESS_FAULTS}
        self._ready = False

    def presses(self, ball_in: Callable[[LiveFrames], Ball]) -> Iterator[tuple[LiveFrames, Ball]]:
        """Ask for presses until none comes any more; yield each with its ball.

        Each press is held still, and before it the film was at rest.

        Parameters
        ----------
        ball_in
            Finds the ball, or raises an `InputError`; then the person is shown why and asked for
            another press.
        """
        while (press := self._next_press()) is not None:
            try:
                ball = ball_in(press)
            except InputError as error:
                tell(f"{error}: let go, and press again.")
                continue
            yield press, ball

    def _next_press(self) -> LiveFrames | None:
        if self._await("untouched", "Let go: the film has to come to rest.") is None:
            return None
        tell(line := "Press the ball into the film, and hold it still.")
        return self._await("pressed", line)

    def _await(self, state: State, line: str) -> LiveFrames | None:
        """Wait for a lasting state; repeat the request from time to time."""
        self._recent.clear()
        reminded = time.monotonic()
        faults: list[str] = []
        for touch in self._stream.touches(POLL_S, self._patience, to=faults.append):
            self._tell_once(faults)
            if self._state(touch) == state:
                self._ready = True
                return touch
            if time.monotonic() - reminded > REMINDER_S:
                reminded = time.monotonic()
                tell(line)
        return None

    def _tell_once(self, faults: list[str]) -> None:
        """Report each fault once, except those of finding the LEDs' phase at the start."""
        for fault in faults:
            if self._ready and fault not in self._reported:
                self._reported.add(fault)
                tell(f"warning: {fault}")
        faults.clear()

    def _state(self, touch: LiveFrames) -> State:
        """The state in which the film has been for long enough."""
        film = self._film
        now = np.stack([cells(plane) for plane in touch.image]) - film.dark
        self._recent.append((touch.time, now))
        if touch.time - self._recent[0][0] < self._still:
            return "between"
        while len(self._recent) > 1 and touch.time - self._recent[1][0] >= self._still:
            self._recent.popleft()
        if any(_change(now, before, film.patterns) > MIN_MOTION for _, before in self._recent):
            return "between"
        departure = _change(now, film.patterns, film.patterns)
        if departure < MAX_REST_CHANGE:
            return "untouched"
        return "pressed" if departure > MIN_PRESS_CHANGE else "between"
