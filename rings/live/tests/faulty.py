"""A simulated sensor that fails as real ones do: its camera, its cable, its LED controller."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Self

import cv2
import numpy as np
import pytest

from tactograph.rings.live.nodes.simulated.simulated_camera import SimulatedCamera
from tactograph.rings.live.nodes.simulated.simulated_controller import SimulatedController
from tactograph.rings.live.nodes.simulated.simulated_sensor import SimulatedSensor
from tactograph.rings.live.nodes.touches import sensor as live_sensor


@dataclass
class Faults:
    """What is wrong with a camera.

    `plugged`: its cable is in.  `covered`, `flooded`: so is its lens; other light saturates it.
    `frozen`: its driver hangs.  `size`: what it delivers, whatever is requested.  `frames`: faults
    of the next frames, one each: "double", "lose", "swap", "late" or "none".
    """

    plugged: bool = True
    covered: bool = False
    flooded: bool = False
    frozen: bool = False
    size: tuple[int, int] | None = None
    frames: deque[str] = field(default_factory=deque)


def faults_of(sensor: SimulatedSensor | None) -> Faults:
    """The faults of all cameras above a sensor."""
    assert sensor is not None
    faults: Faults = vars(sensor).setdefault("injected_faults", Faults())
    return faults


class FaultyCamera(SimulatedCamera):
    """A camera with the faults of its sensor."""

    _swapped: tuple[float, Any] | None = None

    def isOpened(self) -> bool:  # noqa: N802
        return super().isOpened() and faults_of(self.sensor).plugged

    def grab(self) -> bool:
        faults = faults_of(self.sensor)
        while faults.frozen and not self._released.wait(0.01):
            pass
        fault = faults.frames.popleft() if faults.frames else "none"
        if fault == "double" and self._current is not None:
            return self.isOpened()
        if self._swapped is not None:
            (self._time, self._current), self._swapped = self._swapped, None
            return self.isOpened()
        if not super().grab():
            return False
        first = self._time, self._current
        if fault in ("lose", "swap") and not super().grab():
            return False
        if fault == "swap":
            self._swapped, self._time = (self._time, first[1]), first[0]
        elif fault == "late":
            self._released.wait(1 / self.rate)
            self._time += 1 / self.rate
        return self.isOpened()

    def _image(self, end: float) -> Any:
        image, faults = super()._image(end), faults_of(self.sensor)
        if faults.covered or faults.flooded:
            # Noise, because no two frames are the same.
            image = np.random.default_rng().integers(0, 2, image.shape, np.uint8)
            image += np.uint8(254 * faults.flooded)
        return image if faults.size is None else cv2.resize(image, faults.size)


class FaultyController(SimulatedController):
    """A controller that can be unplugged, hang, and send nonsense.

    Parameters
    ----------
    protocol : the protocol version that it reports
    link : a path that always points to its port, like a link that a udev rule makes

    Attributes
    ----------
    burnt_out : LEDs that give no light
    garble : changes each line on its way to the host; None: lines arrive unchanged
    """

    def __init__(
        self, leds: int = 4, *, protocol: int | None = None, link: Path | None = None,
        **about: Any,
    ) -> None:  # fmt: skip
        self.burnt_out: set[int] = set()
        self.garble: Callable[[bytes], bytes] | None = None
        self._protocol, self._link = protocol, link
        self._frozen_until = 0.0
        super().__init__(leds, **about)
        self._follow()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def asked_to_quit(self) -> bool:
        """Tell if the host has asked the firmware to end."""
        with self._lock:
            return self._controller.asked_to_quit

    def unplug(self) -> None:
        """Pull its cable: no port and no power."""
        with self._lock:
            self._advance()
            self.halt()
            self._darken()
            ends = self._main, self._far
            self._open()  # another one, whose name nobody knows
            for end in ends:
                os.close(end)
            if self._link is not None:
                self._link.unlink(missing_ok=True)

    def replug(self) -> None:
        """Plug it in again; it restarts on another port."""
        with self._lock:
            self.port = os.ttyname(self._far)
            self._follow()
            self._boot()

    def reset(self) -> None:
        """Restart while the port stays open, like a reset button behind a USB-UART converter."""
        with self._lock:
            self._advance()
            self._darken()
            self._boot()

    def freeze(self, seconds: float) -> None:
        """Hang for some time, and lose all input meanwhile."""
        with self._lock:
            self._darken()
            self._frozen_until = time.monotonic() + seconds

    def noise(self, data: bytes) -> None:
        """Send meaningless bytes to the host."""
        with self._lock:
            super().send(data)

    def send(self, data: bytes) -> None:
        super().send(data if self.garble is None else self.garble(data))

    def light(self, led: int, on: int) -> None:
        super().light(led, 0 if led in self.burnt_out else on)

    def _follow(self) -> None:
        if self._link is not None:
            self._link.unlink(missing_ok=True)
            self._link.symlink_to(self.port)

    def _boot(self) -> None:
        self._frozen_until = 0.0
        super()._boot()
        if self._protocol is not None:
            self._controller.protocol = self._protocol

    @property
    def _is_frozen(self) -> bool:
        return time.monotonic() < self._frozen_until

    def _advance(self) -> None:
        if not self._is_frozen:
            super()._advance()

    def _listen(self, main: int) -> None:
        if not self._is_frozen:
            super()._listen(main)
            return
        with suppress(OSError):
            os.read(main, 4096)


def let_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let simulated sensors that are opened from now on have faults."""
    monkeypatch.setattr(live_sensor, "SimulatedCamera", FaultyCamera)
    monkeypatch.setattr(live_sensor, "SimulatedController", FaultyController)


def on_usb(monkeypatch: pytest.MonkeyPatch, *boards: SimulatedController) -> None:
    """Let boards be found by their USB id."""

    def comports() -> list[SimpleNamespace]:
        pico = {"vid": 0x2E8A, "pid": 0x0005, "description": "Board in FS mode"}
        mouse = SimpleNamespace(device="/dev/ttyUSB9", vid=0x1234, pid=1, description="Mouse")
        plugged = [b for b in boards if Path(b.port).exists()]
        return [mouse, *(SimpleNamespace(device=b.port, **pico) for b in plugged)]

    monkeypatch.setattr("serial.tools.list_ports.comports", comports)
