"""A sensor at work: its camera, its LEDs, and what its film looks like; real or simulated."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Protocol

from tactograph.graph import InputError
from tactograph.nodes import Dark, Height
from tactograph.nodes._camera import Camera, Capture, Wanted, check_camera, open_capture
from tactograph.nodes._match_frames import Clock, Film, make_film
from tactograph.nodes._simulated_camera import (
    LitBetween,
    SimulatedCamera,
    SimulatedSensor,
    read_scene,
)
from tactograph.nodes.read_calibration import read_calibration

FREE = "none"
"""The port of LEDs that flash by themselves."""
SIMULATED = "simulated"
START_S = 3.0
"""A camera has so long to deliver its first frame."""


class Lamps(Protocol):
    """The LEDs: what they do by the clock, and what went wrong with their controller."""

    faults: Counter[str]

    @property
    def clock(self) -> Clock | None:
        """The LED that is lit at a moment; None if nobody knows."""

    @property
    def starts(self) -> int:
        """How often the cycle was started."""

    def shift(self) -> None:
        """Start the cycle anew, some part of a step later: frames show two LEDs."""

    def close(self) -> None:
        """Switch all LEDs off and let go of the controller."""


@dataclass
class FreeLamps:
    """LEDs that flash by themselves: nothing is known of them, nothing can be done."""

    clock: None = None
    starts: int = 1
    faults: Counter[str] = field(default_factory=Counter)

    def shift(self) -> None:
        """Not possible."""

    def close(self) -> None:
        """Nothing to close."""


@dataclass
class Sensor:
    """What `read_camera` works with.

    `film` and `dark` come from the calibration; `truth` is the true height at the end of an
    exposure, which only a simulated sensor knows.
    """

    camera: Camera
    lamps: Lamps
    film: Film
    dark: Dark
    cycle: tuple[int, ...]
    rate: float
    truth: Callable[[float], Height] | None = None

    def close(self) -> None:
        """LEDs off, camera closed."""
        try:
            self.lamps.close()
        finally:
            self.camera.close()


def steady(cycle: Sequence[int], rate: float, start: float) -> LitBetween:
    """LEDs of a simulated sensor that flash by themselves, in step with its camera."""

    def lit_between(begin: float, end: float) -> list[tuple[int, float]]:
        middle = (begin + end) / 2
        return [(cycle[math.floor((middle - start) * rate) % len(cycle)], 1.0)]

    return lit_between


def open_sensor(
    camera: int | str,
    port: str | None,
    calibration: Path,
    wanted: Wanted,
    *,
    ambient: bool = False,
    queue: int = 8,
    timeout: float = 0.5,
) -> Sensor:
    """Open what `read_camera` is asked to read.

    Parameters
    ----------
    camera, port, calibration
        As for `read_camera`.
    wanted
        What the camera is asked for.
    ambient
        Whether the cycle has a step with all LEDs off.
    queue, timeout
        As for `Camera`.

    Raises
    ------
    InputError
        If the calibration, the camera or the controller cannot be opened.
    """
    known = read_calibration(file=calibration)
    count, height, width = known.flat.shape
    wanted = replace(wanted, width=width, height=height)
    cycle = (*range(1, count + 1), *((0,) if ambient else ()))
    truth: Callable[[float], Height] | None = None
    once = False
    if str(camera).partition("?")[0] == SIMULATED:
        table = SimulatedSensor(read_scene(str(camera)))
        lamps, lit_between = _simulated_lamps(port, cycle, wanted.rate, table.start)
        connect: Callable[[], Capture] = partial(SimulatedCamera, table, lit_between)
        truth = table.truth
    else:
        once = check_camera(camera)
        lamps = _lamps(port, cycle, wanted.rate)
        connect = partial(open_capture, camera)
    source = Camera(connect, wanted, queue=queue, timeout=timeout, once=once)
    sensor = Sensor(
        source, lamps, make_film(known.flat, known.dark), known.dark, cycle, wanted.rate, truth
    )
    try:
        source.check(START_S)
    except InputError:
        sensor.close()
        raise
    return sensor


def _simulated_lamps(
    port: str | None, cycle: tuple[int, ...], rate: float, start: float
) -> tuple[Lamps, LitBetween]:
    if port == FREE:
        return FreeLamps(), steady(cycle, rate, start)
    raise InputError("no controller yet")


def _lamps(port: str | None, cycle: tuple[int, ...], rate: float) -> Lamps:
    if port == FREE:
        return FreeLamps()
    raise InputError("no controller yet")
