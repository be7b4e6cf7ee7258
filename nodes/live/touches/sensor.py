"""A live sensor, real or simulated: its camera, its LEDs, and its film at rest."""

from __future__ import annotations

import math
import shutil
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path
from tempfile import mkdtemp
from typing import Protocol

from tactograph.graph import InputError
from tactograph.nodes import Dark, Height, Light
from tactograph.nodes.live.camera.camera import Camera
from tactograph.nodes.live.camera.open_camera import (
    CameraSettings,
    Capture,
    Library,
    check_camera,
    open_capture,
)
from tactograph.nodes.live.controller.led_controller import (
    ControllerLostError,
    ControllerRefusedError,
    LedController,
    open_controller,
)
from tactograph.nodes.live.simulated.simulated_camera import LitBetween, SimulatedCamera
from tactograph.nodes.live.simulated.simulated_controller import SimulatedController
from tactograph.nodes.live.simulated.simulated_sensor import Scene, SimulatedSensor, read_scene
from tactograph.nodes.live.touches._match_frames import Clock
from tactograph.nodes.stream.led_in_frame import RestFilm, make_film

NO_PORT = "none"
"""The port of LEDs that flash by themselves."""
SIMULATED_NAME = "simulated"
START_S = 3.0
"""Longest time until a camera's first frame."""
CLOCK_SAMPLES = 64
"""Times per step at which the clock is searched for the next change."""


class Lamps(Protocol):
    """The LEDs: their clock, and the faults of their controller."""

    @property
    def faults(self) -> Counter[str]:
        """Count of each fault."""

    @property
    def clock(self) -> Clock | None:
        """A function that gives the LED lit at a time; None if it is unknown."""

    @property
    def starts(self) -> int:
        """Count of the cycle's starts."""

    def shift(self, steps: float) -> None:
        """Restart the cycle so that it changes LEDs `steps` of a step later."""

    def hold(self, led: int) -> None:
        """Light one LED, 0 for none, until the cycle is resumed."""

    def resume(self) -> None:
        """Start the cycle again."""

    def news(self) -> list[str]:
        """Events since the last call, one line each."""

    def close(self) -> None:
        """Switch all LEDs off and release the controller."""


@dataclass
class FreeLamps:
    """LEDs that flash by themselves, without any knowledge or control of them."""

    clock: None = None
    starts: int = 1
    faults: Counter[str] = field(default_factory=Counter)

    def shift(self, steps: float) -> None:
        """Do nothing: these LEDs obey nobody."""

    def hold(self, led: int) -> None:
        """Raise an error: these LEDs cannot do it."""
        raise InputError(
            "port=none: LEDs that flash by themselves cannot be lit one by one; calibrate with "
            "images of your own (tactograph run calibrate capture=DIR flat=DIR)"
        )

    def resume(self) -> None:
        """Do nothing: the LEDs never stopped."""

    def news(self) -> list[str]:
        """Return no events."""
        return []

    def close(self) -> None:
        """Do nothing: there is nothing to close."""


class ControlledLamps:
    """LEDs that a controller steps through the cycle, one step per camera frame.

    It is not known beforehand whether frames overlap with neighbouring steps.  The frames show
    it, and `shift` then moves the cycle relative to them.
    """

    def __init__(self, controller: LedController, cycle: Sequence[int], rate: float) -> None:
        self._controller = controller
        self._cycle = cycle
        self._step = 1 / rate
        self._shifts = 0
        self._start()

    @property
    def clock(self) -> Clock:
        """The controller's clock."""
        return self._controller.step_at

    @property
    def faults(self) -> Counter[str]:
        """The controller's fault counts."""
        return self._controller.faults

    @property
    def starts(self) -> int:
        """Count of the cycle's starts, by us or after a fault."""
        return 1 + self._shifts + len(self._controller.recoveries)

    def shift(self, steps: float) -> None:
        """Restart the cycle so that it changes LEDs `steps` of a step later."""
        self._shifts += 1
        change = self._next_change(time.monotonic() + self._step / 4)
        if change is not None:
            wait = change + (steps % 1) * self._step - time.monotonic()
            # The request takes half of the round trip.
            with suppress(ControllerLostError, ControllerRefusedError):
                wait -= self._controller.status().round_trip_s / 2
            time.sleep(max(wait, 0))
        self._start()

    def hold(self, led: int) -> None:
        """Light one LED, 0 for none, until the cycle is resumed."""
        self._controller.set(led)

    def resume(self) -> None:
        """Start the cycle again."""
        self._shifts += 1
        self._start()

    def news(self) -> list[str]:
        """Events of the controller, one line each."""
        return self._controller.news()

    def close(self) -> None:
        """LEDs off."""
        self._controller.close()

    def _start(self) -> None:
        # A lost controller starts the cycle by itself once it is back.
        with suppress(ControllerLostError, ControllerRefusedError):
            self._controller.start_cycle(self._cycle, step_s=self._step)

    def _next_change(self, after: float) -> float | None:
        """The time of the controller's next step; None if unknown."""
        grid = [after + self._step * i / CLOCK_SAMPLES for i in range(2 * CLOCK_SAMPLES)]
        lit = [self.clock(moment) for moment in grid]
        pairs = pairwise(zip(grid, lit, strict=True))
        return next((moment for (_, one), (moment, two) in pairs if one != two), None)


@dataclass
class Rig:
    """A running camera and its LEDs, whose film at rest is not known yet.

    Attributes
    ----------
    table, board, link
        The simulated sensor and controller, and the path of its port.
    """

    camera: Camera
    lamps: Lamps
    cycle: tuple[int, ...]
    rate: float
    table: SimulatedSensor | None
    board: SimulatedController | None
    link: Path | None

    def with_film(self, flat: Light, dark: Dark) -> Sensor:
        """The sensor, once its film at rest is known: K x H x W and H x W."""
        return Sensor(
            self.camera,
            self.lamps,
            self.cycle,
            self.rate,
            self.table,
            self.board,
            self.link,
            make_film(flat, dark),
            dark,
        )

    def truth(self, end: float) -> Height | None:
        """The true height for a frame whose exposure ended at `end`, if known."""
        return None if self.table is None else self.table.truth(end)

    def close(self) -> None:
        """Switch the LEDs off and close the camera."""
        with ExitStack() as stack:
            if self.board is not None:
                stack.callback(self.board.close)
            if self.link is not None:
                stack.callback(shutil.rmtree, self.link.parent, ignore_errors=True)
            stack.callback(self.camera.close)
            stack.callback(self.lamps.close)


@dataclass
class Sensor(Rig):
    """A rig with the film at rest from its calibration, as `read_camera` uses it."""

    film: RestFilm
    dark: Dark


def steady(cycle: Sequence[int], rate: float, start: float) -> LitBetween:
    """LEDs of a simulated sensor that flash by themselves, in step with its camera."""

    def lit_between(begin: float, end: float) -> list[tuple[int, float]]:
        middle = (begin + end) / 2
        return [(cycle[math.floor((middle - start) * rate) % len(cycle)], 1.0)]

    return lit_between


def open_sensor(
    camera: int | str,
    port: str | None,
    flat: Light,
    dark: Dark,
    wanted: CameraSettings,
    *,
    ambient: bool = False,
    library: Library = "opencv",
    queue: int = 8,
    timeout: float = 0.5,
) -> Sensor:
    """Open the sensor for `read_camera`, like `open_rig`.

    Parameters
    ----------
    flat, dark
        From the calibration, K x H x W and H x W.
    """
    rig = open_rig(
        camera,
        port,
        wanted,
        leds=len(flat),
        ambient=ambient,
        library=library,
        queue=queue,
        timeout=timeout,
    )
    try:
        return rig.with_film(flat, dark)
    except BaseException:
        rig.close()
        raise


def open_rig(
    camera: int | str,
    port: str | None,
    wanted: CameraSettings,
    *,
    leds: int,
    ambient: bool = False,
    library: Library = "opencv",
    queue: int = 8,
    timeout: float = 0.5,
) -> Rig:
    """Open a camera and start the cycle of its LEDs.

    Parameters
    ----------
    camera, port
        As for `read_camera`.
    wanted
        The settings to request from the camera.
    leds
        Number of LEDs.
    ambient
        Whether the cycle has a step with all LEDs off.
    library
        As for `read_camera`.
    queue, timeout
        As for `Camera`.

    Raises
    ------
    InputError
        If the camera or the controller cannot be opened.
    """
    cycle = (*range(1, leds + 1), *((0,) if ambient else ()))
    table: SimulatedSensor | None = None
    board: SimulatedController | None = None
    link: Path | None = None
    once = False
    with ExitStack() as undo:
        # Close everything again if a later step fails or Ctrl-C is pressed.
        if str(camera).partition("?")[0] == SIMULATED_NAME:
            table = SimulatedSensor(read_scene(str(camera), Scene))
            lit_between = steady(cycle, wanted.rate, table.start)
            if port == SIMULATED_NAME:
                # A replugged controller has another port; a link points to it, as udev's do.
                link = Path(mkdtemp()) / "controller"
                undo.callback(shutil.rmtree, link.parent, ignore_errors=True)
                board = SimulatedController(leds=leds, link=link)
                undo.callback(board.close)
                port, lit_between = str(link), board.lit_between
            connect: Callable[[], Capture] = partial(SimulatedCamera, table, lit_between)
        elif port == SIMULATED_NAME:
            raise InputError("port=simulated goes with camera=simulated")
        else:
            once = check_camera(camera, library)
            connect = partial(open_capture, camera, library)
        lamps = open_lamps(port, cycle, wanted.rate)
        undo.callback(lamps.close)
        source = Camera(connect, wanted, queue=queue, timeout=timeout, once=once)
        undo.callback(source.close)
        source.check(START_S, camera)
        undo.pop_all()
    return Rig(source, lamps, cycle, wanted.rate, table, board, link)


def open_lamps(port: str | None, cycle: tuple[int, ...], rate: float) -> Lamps:
    """Start the cycle of the LEDs on a port, unless they flash by themselves.

    Raises
    ------
    InputError
        If the controller cannot be opened.
    """
    if port == NO_PORT:
        return FreeLamps()
    controller = open_controller(port, leds=max(cycle))
    try:
        return ControlledLamps(controller, cycle, rate)
    except BaseException:
        controller.close()
        raise
