"""A simulated camera above a simulated sensor, with the interface of ``cv2.VideoCapture``."""

import math
import threading
import time
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
    _current: NDArray[np.uint8] | None = None

    def isOpened(self) -> bool:  # noqa: N802  (OpenCV's names)
        """Tell if frames can be expected."""
        return self._open

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
        values = {
            cv2.CAP_PROP_FRAME_WIDTH: float(scene.width_px),
            cv2.CAP_PROP_FRAME_HEIGHT: float(scene.height_px),
            cv2.CAP_PROP_FPS: self.rate,
            cv2.CAP_PROP_POS_MSEC: 1e3 * self._time,
        }
        return values.get(prop, 0.0)

    def grab(self) -> bool:
        """Wait for the next frame to be exposed and read out; False if there will be none."""
        now = time.monotonic()
        # A camera does not wait: frames that were not fetched in time are lost.
        self.number = max(self.number + 1, math.floor((now - self.sensor.start) * self.rate))
        end = self.sensor.start + (self.number + 1) / self.rate
        if self._released.wait(max(end - now, 0)) or not self.isOpened():
            return False
        self._time, self._current = end, self._image(end)
        return self.isOpened()

    def retrieve(self) -> tuple[bool, NDArray[np.uint8] | None]:
        """The frame that `grab` took: H x W, 8 bit."""
        return self._current is not None, self._current

    def _image(self, end: float) -> NDArray[np.uint8]:
        """What an exposure that ended at `end` has recorded."""
        middle = end - 0.5 * (self.sensor.exposure_s + self.sensor.scene.readout_s)
        if self.lit_between is None:
            assert isinstance(self.sensor, SimulatedColourSensor | CalibratedSensor)
            return self.sensor.picture(middle, self.number)
        return self.sensor.image(self._shares(end), middle, self.number)

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
