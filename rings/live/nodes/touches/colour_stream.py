"""The stream of touches of a live one-shot sensor: one per colour frame."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from tactograph.rings.frames.colour_planes import Order, planes_of
from tactograph.rings.frames.live_frames import ALL_LIT, LiveFrames, RawFrame
from tactograph.rings.frames.rest_film import RestFilm, cells, top_of
from tactograph.rings.live.nodes.camera.camera import Shot
from tactograph.rings.live.nodes.camera.open_camera import Plane
from tactograph.rings.live.nodes.touches.fault_log import FAULT_LINES, FaultLog
from tactograph.rings.live.nodes.touches.led_in_frame import MAX_DARK_LIGHT, MAX_SATURATED_SHARE
from tactograph.rings.live.nodes.touches.sensor import Sensor
from tactograph.rings.live.nodes.touches.touch_stream import MAX_BRIGHTNESS_CHANGE, TouchStream
from tactograph.sdk import LiveState

COLOUR_NAMES = {"b": "blue", "g": "green", "r": "red"}
COLOUR_FAULTS = FAULT_LINES | {
    "covered": "a frame is dark: discarded; is the lens covered, or are the LEDs off?",
    "brightness": "{led} is not as bright as calibrated: followed, but look at the LEDs and the "
    "camera's exposure",
}
"""One line of explanation for every fault."""


@dataclass
class ColourStream(TouchStream):
    """Turns a camera's colour frames into touches.

    Parameters
    ----------
    sensor : not closed here
    film : the film at rest; each colour counts as an LED
    order : the channels that are the lights, in the calibration's order
    full : the camera's largest value; 0: that of the frame's type
    state : the counters
    """

    sensor: Sensor
    film: RestFilm
    order: Order = "bgr"
    full: float = 0.0
    state: LiveState = field(default_factory=LiveState)

    def __post_init__(self) -> None:
        self._camera = self.sensor.camera
        self._log = FaultLog(self.state, None, COLOUR_FAULTS)
        self._connected = (self._camera.connections,)
        self._restart = self._log.restart
        self._before: Plane | None = None

    def _touch_with(self, shots: list[Shot]) -> LiveFrames | None:
        # Newer frames replace all but the last.
        self._camera.faults["dropped"] += max(len(shots) - 1, 0)
        self._supervise(Counter(self._camera.faults), (self._camera.connections,))
        usable = [shot for shot in shots if self._is_usable(shot)]
        return self._touch(usable) if usable else None

    def _is_usable(self, shot: Shot) -> bool:
        """Tell if a frame shows the film; otherwise count its fault."""
        self._log.count(shot)
        fault = self._fault(shot.data)
        if fault:
            self._log.note(fault)
        if fault == "wrong size":
            self._reopen()
        return not fault

    def _fault(self, data: Plane) -> str:
        if data.shape != (*self.film.size, len(self.film.patterns)):
            return "wrong size"
        # A few rows detect saturation as well as all rows.
        sample = data[::5].copy()
        saturated = np.count_nonzero(np.greater_equal(sample, top_of(data, self.full)))
        if saturated > MAX_SATURATED_SHARE * sample.size:
            return "saturated"
        before, self._before = self._before, sample
        if before is not None and np.array_equal(sample, before):
            return "doubled"
        return self._judge_brightness(data)

    def _judge_brightness(self, data: Plane) -> str:
        """Discard a dark frame; report a changed colour, but keep its frame."""
        ordered = data if self.order == "bgr" else data[..., ::-1]
        light = np.moveaxis(cells(ordered), -1, 0) / np.float32(top_of(data, self.full))
        share = light / self.film.scale
        gains = np.median(share.reshape(len(share), -1), axis=1)
        if gains.max() < MAX_DARK_LIGHT:
            return "covered"
        for letter, gain in zip(self.order, gains, strict=True):
            if abs(gain - 1) > MAX_BRIGHTNESS_CHANGE:
                self._log.note("brightness", COLOUR_NAMES[letter])
        return ""

    def _touch(self, shots: list[Shot]) -> LiveFrames:
        """The touch of the newest frame; it carries all frames, for a recording."""
        newest = shots[-1]
        light = planes_of(newest.data, self.order, top_of(newest.data, self.full))
        new = [RawFrame(shot.number, ALL_LIT, shot.time, shot.data) for shot in shots]
        truth = self.sensor.truth(newest.time)
        return LiveFrames.counted(light, newest.time, new, self.state, truth)
