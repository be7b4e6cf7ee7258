"""Assemble frames of single LEDs into touches: the newest light of every LED."""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tactograph.rings.frames.live_frames import RawFrame
from tactograph.rings.frames.rest_film import RestFilm, light_of, top_of
from tactograph.sdk import F4, Dark

Refresh = Literal["rolling", "cycle"]
FRESH_CYCLES = 2
"""Largest time between the frames of one touch, in cycles."""
AMBIENT_SHARE = 0.5
"""Weight of a new ambient frame in the mean that is subtracted."""


@dataclass
class Assembler:
    """Keeps the newest frame of every LED and says when a touch is due.

    Parameters
    ----------
    film : the film at rest, for measuring motion
    dark : H x W: the dark image that the calibration subtracts; ambient light is the excess over it
    cycle : the LEDs in the order of the cycle, 0 for the ambient step
    rate : frames per second
    refresh
        "rolling": a touch with every frame, which replaces the older one of its LED.
        "cycle": a touch whenever all LEDs are new.
    full : the camera's largest value; 0: that of the frame's type
    whole : whether frames may remain the camera's integers
    """

    film: RestFilm
    dark: Dark
    cycle: tuple[int, ...]
    rate: float
    refresh: Refresh = "rolling"
    full: float = 0.0
    whole: bool = False
    _frames: dict[int, RawFrame] = field(default_factory=dict)
    _cells: dict[int, F4] = field(default_factory=dict)
    _changes: dict[int, float] = field(default_factory=dict)
    _new: set[int] = field(default_factory=set)
    _ambient: F4 | None = None

    def add(self, frame: RawFrame, light: F4 | None = None) -> None:
        """Take a frame; LED 0 means ambient light.  `light` is its `light_of`, if known already."""
        if frame.led == 0:
            plane, before = frame.data * self._scale(frame) - self.dark, self._ambient
            self._ambient = plane if before is None else before + AMBIENT_SHARE * (plane - before)
            return
        light = light_of(frame.data, self.full) if light is None else light
        if frame.led in self._cells:
            change = np.abs(light - self._cells[frame.led]) / self.film.scale[frame.led - 1]
            self._changes[frame.led] = float(change.max())
        self._cells[frame.led] = light
        self._frames[frame.led] = frame
        self._new.add(frame.led)

    def _scale(self, frame: RawFrame) -> np.float32:
        return np.float32(1 / top_of(frame.data, self.full))

    @property
    def due(self) -> bool:
        """Return whether a frame is new, and all LEDs' frames recent enough to belong together."""
        leds = [led for led in self.cycle if led]
        if not self._new or any(led not in self._frames for led in leds):
            return False
        if self.refresh == "cycle" and len(self._new) < len(leds):
            return False
        times = [self._frames[led].time for led in leds]
        return max(times) - min(times) <= FRESH_CYCLES * len(self.cycle) / self.rate

    @property
    def newest(self) -> RawFrame:
        """The frame whose exposure ended last."""
        return max(self._frames.values(), key=lambda frame: frame.time)

    @property
    def motion(self) -> float:
        """Largest change of the light, 1 on the film at rest, from one cycle to the next.

        The frames of a touch are spread over a cycle; a change within it makes their light
        inconsistent.
        """
        return max(self._changes.values(), default=0.0)

    def take(self) -> NDArray[Any]:
        """Return the touch, K x H x W, and mark all frames as old.

        Fractions of full scale, or integers if these are allowed and use all bits of their type.
        """
        self._new.clear()
        frames = [self._frames[led] for led in sorted(self._frames)]
        if self.whole and not self.full and 0 not in self.cycle:
            return np.stack([frame.data for frame in frames])
        touch = np.empty((len(frames), *frames[0].data.shape), np.float32)
        for plane, frame in zip(touch, frames, strict=True):
            np.multiply(frame.data, self._scale(frame), out=plane)
            if self._ambient is not None:
                plane -= self._ambient
        return touch

    def restart(self) -> None:
        """Forget all frames except the ambient light."""
        for state in (self._frames, self._cells, self._changes, self._new):
            state.clear()
