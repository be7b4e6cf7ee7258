"""A live sensor, real or simulated: its camera and its LEDs."""

import math
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path

from tactograph.rings.frames.colour_planes import Order
from tactograph.rings.live.nodes.camera.camera import Camera
from tactograph.rings.live.nodes.camera.camera_params import SIMULATED_NAME, CameraParams
from tactograph.rings.live.nodes.camera.open_camera import (
    CameraSettings,
    Capture,
    check_camera,
    open_capture,
)
from tactograph.rings.live.nodes.camera.sensor_kind import Size, camera_settings, film_of, preset_of
from tactograph.rings.live.nodes.camera.sensor_preset import SensorPreset
from tactograph.rings.live.nodes.controller.led_controller import LedController, open_controller
from tactograph.rings.live.nodes.simulated.calibrated_sensor import calibrated_sensor
from tactograph.rings.live.nodes.simulated.simulated_camera import LitBetween, SimulatedCamera
from tactograph.rings.live.nodes.simulated.simulated_colour_sensor import (
    ColourScene,
    SimulatedColourSensor,
)
from tactograph.rings.live.nodes.simulated.simulated_controller import SimulatedController
from tactograph.rings.live.nodes.simulated.simulated_sensor import (
    Scene,
    SimulatedSensor,
    read_scene,
)
from tactograph.rings.live.nodes.touches._match_frames import Clock
from tactograph.sdk import Height, InputError, TactographError

NO_PORT = "none"
"""The port of LEDs that flash by themselves."""
START_S = 3.0
"""Longest time until a camera's first frame."""
CLOCK_SAMPLES = 64
"""Times per step at which the clock is searched for the next change."""


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
            "`port`=none: LEDs that flash by themselves cannot be lit one by one; calibrate with "
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
            with suppress(TactographError):
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
        with suppress(TactographError):
            self._controller.start_cycle(self._cycle, step_s=self._step)

    def _next_change(self, after: float) -> float | None:
        """The time of the controller's next step; None if unknown."""
        grid = [after + self._step * i / CLOCK_SAMPLES for i in range(2 * CLOCK_SAMPLES)]
        lit = [self.clock(moment) for moment in grid]
        pairs = pairwise(zip(grid, lit, strict=True))
        return next((moment for (_, one), (moment, two) in pairs if one != two), None)


Lamps = FreeLamps | ControlledLamps


@dataclass
class Sensor:
    """A running camera; of a simulated one also `table`, the film that it sees."""

    camera: Camera
    table: SimulatedSensor | None

    def truth(self, end: float) -> Height | None:
        """The true height for a frame whose exposure ended at `end`, if known."""
        return None if self.table is None else self.table.truth(end)

    def close(self) -> None:
        """Close the camera."""
        self.camera.close()


@dataclass
class Rig(Sensor):
    """A sensor whose LEDs flash; if they are simulated, also their controller."""

    lamps: Lamps
    cycle: tuple[int, ...]
    rate: float
    board: SimulatedController | None
    closing: ExitStack

    def close(self) -> None:
        """Close the camera and switch the LEDs off."""
        self.closing.close()


def steady(cycle: Sequence[int], rate: float, start: float) -> LitBetween:
    """LEDs of a simulated sensor that flash by themselves, in step with its camera."""

    def lit_between(begin: float, end: float) -> list[tuple[int, float]]:
        middle = (begin + end) / 2
        return [(cycle[math.floor((middle - start) * rate) % len(cycle)], 1.0)]

    return lit_between


def open_rig(
    driver: CameraParams,
    port: str | None,
    size: Size,
    *,
    leds: int,
    ambient: bool = False,
    queue: int = 8,
    calibration: Path | None = None,
) -> Rig:
    """Open a camera and start the cycle of its LEDs.

    Parameters
    ----------
    driver, port : as for `read_camera`
    size : of the frames to request
    leds : number of LEDs
    ambient : whether the cycle has a step with all LEDs off
    queue, calibration : as for `open_colour_sensor`

    Raises
    ------
    InputError
        If the camera or the controller cannot be opened, or the preset is of another kind or
        size.
    """
    preset = preset_of(driver.sensor, flashing=True)
    cycle = (*range(1, leds + 1), *((0,) if ambient else ()))
    board: SimulatedController | None = None
    lit_between: LitBetween | None = None
    table = _simulated(driver, preset, calibration)
    # Before LEDs are looked for.
    once = table is None and check_camera(driver.camera, driver.library)
    with ExitStack() as undo:
        # Close everything again if a later step fails or Ctrl-C is pressed.
        if table is not None:
            lit_between = steady(cycle, driver.rate, table.start)
        if port == SIMULATED_NAME:
            if table is None:
                raise InputError("`port`=simulated goes with `camera`=simulated")
            board = SimulatedController(leds)
            undo.callback(board.close)
            port, lit_between = board.port, board.lit_between
        lamps = open_lamps(port, cycle, driver.rate)
        undo.callback(lamps.close)
        settings = camera_settings(driver, size, None if table else preset, colour=False)
        camera = _open_camera(driver, settings, queue, table, lit_between, once=once)
        undo.callback(camera.close)
        return Rig(camera, table, lamps, cycle, driver.rate, board, undo.pop_all())


def open_colour_sensor(
    driver: CameraParams,
    size: Size,
    *,
    queue: int = 8,
    calibration: Path | None = None,
    order: Order = "bgr",
) -> Sensor:
    """Open a one-shot sensor's camera, real or simulated, and check that it delivers frames.

    Parameters
    ----------
    driver
        As for `read_camera`.  The view of its preset is applied to a real camera's pictures; a
        simulated one delivers frames to which it is already applied.
    size : of the frames to request
    queue : as for `Camera`
    calibration : of the film that a simulated camera sees, unless its scene states a rig
    order : of the colours in that calibration

    Raises
    ------
    InputError
        If the camera cannot be opened, or delivers nothing, another size, or grey pictures; if
        the preset is of another kind or size.
    """
    preset = preset_of(driver.sensor, flashing=False)
    table = _simulated(driver, preset, calibration, order)
    settings = camera_settings(driver, size, None if table else preset, colour=True)
    once = table is None and check_camera(driver.camera, driver.library)
    return Sensor(_open_camera(driver, settings, queue, table, once=once), table)


def _simulated(
    driver: CameraParams,
    preset: SensorPreset | None,
    calibration: Path | None,
    order: Order | None = None,
) -> SimulatedSensor | None:
    """The film under a simulated camera; one of an `order` is lit by all colours at once."""
    if not driver.is_simulated:
        return None
    text = str(driver.camera)
    sensor = calibrated_sensor(text, calibration, order or "bgr") if calibration else None
    if sensor is not None:
        return sensor
    if order is None:
        return SimulatedSensor(read_scene(text, Scene, film_of(preset)))
    return SimulatedColourSensor(read_scene(text, ColourScene, film_of(preset)))


def _open_camera(
    driver: CameraParams,
    settings: CameraSettings,
    queue: int,
    table: SimulatedSensor | None,
    lit_between: LitBetween | None = None,
    *,
    once: bool,
) -> Camera:
    """A camera, real or simulated, that delivers frames; those of a file come `once`."""
    connect: Callable[[], Capture]
    if table is not None:
        connect = partial(SimulatedCamera, table, lit_between)
    else:
        connect = partial(open_capture, driver.camera, driver.library, colour=settings.colour)
    camera = Camera(connect, settings, queue=queue, timeout=driver.timeout_s, once=once)
    try:
        camera.check(START_S, driver.camera)
    except BaseException:
        camera.close()
        raise
    return camera


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
