"""A simulated camera above a simulated sensor, with the interface of ``cv2.VideoCapture``."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.rings.live.nodes.simulated.calibrated_sensor import CalibratedSensor
from tactograph.rings.live.nodes.simulated.simulated_colour_sensor import SimulatedColourSensor
from tactograph.rings.live.nodes.simulated.simulated_sensor import (
    EXPOSURE_S,
    EXPOSURE_SHARE,
    SimulatedSensor,
)
from tactograph.sdk import F4

LitBetween = Callable[[float, float], Sequence[tuple[int, float]]]
"""The LEDs that are lit between two times of time.monotonic(), and for what share of it."""
ROW_GROUPS = 24
"""Number of groups in which a rolling shutter's rows are exposed."""


@dataclass
class SimulatedCamera:
    """A connection to a simulated sensor: the needed part of ``cv2.VideoCapture``.

    Frames end at whole multiples of the frame time, whether they are fetched or not.

    Parameters
    ----------
    sensor : the sensor that it sees
    lit_between
        The simulated controller's LEDs.  None: all are lit, and `sensor` is a one-shot sensor.
    full_share
        The share of an exposure for which an LED is lit when controller and camera are in step;
        this gives the calibration's brightness.
    """

    sensor: SimulatedSensor
    lit_between: LitBetween | None
    full_share: float = 1.0
    rate: float = 30.0
    number: int = -1
    _open: bool = field(default=True)
    _time: float = 0.0
    _released: threading.Event = field(default_factory=threading.Event)
    _held: deque[tuple[float, NDArray[np.uint8]]] = field(default_factory=deque)
    _last: tuple[float, NDArray[np.uint8]] | None = None
    _current: NDArray[np.uint8] | None = None

    def isOpened(self) -> bool:  # noqa: N802  (OpenCV's names)
        """Tell if frames can be expected."""
        return self._open and self.sensor.plugged

    def getBackendName(self) -> str:  # noqa: N802
        """Name of the simulation."""
        return "SIMULATED"

    def release(self) -> None:
        """Close the camera; a waiting `grab` returns False."""
        self._open = False
        self._released.set()

    def set(self, prop: int, value: float) -> bool:
        """Set the frame rate, up to the limit by the exposure; the size is the scene's."""
        if prop == cv2.CAP_PROP_FPS and value > 0:
            sensor = self.sensor
            if sensor.scene.exposure_s is None:
                sensor.exposure_s = min(EXPOSURE_S, EXPOSURE_SHARE / value)
            self.rate = min(value, 1 / sensor.exposure_s)
        return prop == cv2.CAP_PROP_FPS

    def get(self, prop: int) -> float:
        """Size, rate and the end of the last frame's exposure in ms of time.monotonic()."""
        scene = self.sensor.scene
        width, height = self.sensor.size or (scene.width_px, scene.height_px)
        values = {
            cv2.CAP_PROP_FRAME_WIDTH: float(width),
            cv2.CAP_PROP_FRAME_HEIGHT: float(height),
            cv2.CAP_PROP_FPS: self.rate,
            cv2.CAP_PROP_POS_MSEC: 1e3 * self._time,
        }
        return values.get(prop, 0.0)

    def grab(self) -> bool:
        """Wait for the next frame to be exposed and read out; False if there will be none."""
        while self.sensor.frozen and not self._released.wait(0.01):
            pass
        fault = self.sensor.faults.popleft() if self.sensor.faults else "none"
        frames = {"lose": 2, "swap": 2, "double": 0 if self._last else 1}.get(fault, 1)
        for _ in range(frames if fault != "none" or not self._held else 0):
            if not self._expose():
                return False
        if fault == "swap":
            (first, one), (second, two) = self._held.pop(), self._held.pop()
            self._held += [(second, one), (first, two)]
        elif fault == "lose":
            self._held.popleft()
        elif fault == "double" and self._last is not None:
            self._held.append(self._last)
        self._time, self._current = self._held.popleft()
        if fault == "late":
            self._released.wait(1 / self.rate)
            self._time += 1 / self.rate
        return self.isOpened()

    def retrieve(self) -> tuple[bool, NDArray[np.uint8] | None]:
        """The frame that `grab` took: H x W, 8 bit."""
        return self._current is not None, self._current

    def _expose(self) -> bool:
        """Wait until the next frame's end and make it."""
        scene, start = self.sensor.scene, self.sensor.start
        now = time.monotonic()
        # A camera does not wait: frames that were not fetched in time are lost.
        self.number = max(self.number + 1, math.floor((now - start) * self.rate))
        end = start + (self.number + 1) / self.rate
        if self._released.wait(max(end - now, 0)) or not self.isOpened():
            return False
        middle = end - 0.5 * (self.sensor.exposure_s + scene.readout_s)
        if self.lit_between is None:
            assert isinstance(self.sensor, SimulatedColourSensor | CalibratedSensor)
            image = self.sensor.picture(middle, self.number)
        else:
            image = self.sensor.image(self._shares(end), middle, self.number)
        if self.sensor.size is not None:
            image = np.asarray(cv2.resize(image, self.sensor.size), np.uint8)
        self._last = end, image
        self._held.append(self._last)
        return True

    def _shares(self, end: float) -> list[F4]:
        """The share of every LED's light that each row receives."""
        assert self.lit_between is not None
        scene = self.sensor.scene
        groups = ROW_GROUPS if scene.readout_s else 1
        shares = np.zeros((len(self.sensor.strength), groups), np.float32)
        for i in range(groups):
            close = end - scene.readout_s * (1 - (i + 1) / groups)
            for led, share in self.lit_between(close - self.sensor.exposure_s, close):
                if 0 < led <= len(shares):
                    shares[led - 1, i] = share / self.full_share
        shares[np.abs(shares - 1) < 0.02] = 1
        group = np.arange(scene.height_px) * groups // scene.height_px
        return list(shares[:, group])
