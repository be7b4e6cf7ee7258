"""Test the LED controller: every LED in turn, then a cycle as with a camera."""

import time
from statistics import median
from typing import Annotated, NamedTuple

from annotated_types import Interval

from tactograph.rings.live.nodes.controller.led_controller import LedController, open_controller
from tactograph.sdk import InputError, node, warn

MEASURED_REQUESTS = 20
"""Requests over which the round trip is measured."""


class LedCheck(NamedTuple):
    """The controller's identity, and the measured figures."""

    controller: str
    figures: dict[str, float]


@node
def check_leds(
    *,
    port: str | None = None,
    leds: Annotated[int, Interval(ge=1, le=8)] = 4,
    seconds_each: Annotated[float, Interval(ge=0.01, le=60)] = 1.0,
    rate_hz: Annotated[float, Interval(ge=0.1, le=1000)] = 30.0,
    cycles: Annotated[int, Interval(ge=1, le=10000)] = 15,
) -> LedCheck:
    """Light every LED for a while, then let them flash, and report the measurements.

    Watch the film meanwhile: LED 1 must light first, on the side that the calibration numbers 1.

    Parameters
    ----------
    port : the controller's serial port; None: found by its USB id
    leds : number of LEDs that the controller must have
    seconds_each : how long each LED is lit
    rate_hz : steps of the cycle per second, equal to the camera's frame rate
    cycles : number of cycles to run; each ends with a dark step

    Returns
    -------
    `controller` gives its firmware, id and port.  `figures`: ``leds``, ``round_trip_ms`` of a
    request (median), ``clock_error_ms`` (uncertainty of the host about when a step begins),
    ``jitter_ms`` (spread of the lines' transmission times), ``cycle_ms`` as timed by the
    controller, and ``bad_lines`` (damaged lines in both directions).

    Raises
    ------
    InputError
        If the controller is not found, does not answer, or is lost during the test.
    """
    with open_controller(port, leds=leds) as controller:
        for led in range(1, leds + 1):
            controller.set(led)
            time.sleep(seconds_each)
        figures = {"leds": float(controller.identity.leds)}
        figures |= _flash(controller, leds, 1 / rate_hz, cycles)
        if figures["bad_lines"]:
            warn(f"{figures['bad_lines']:.0f} lines came damaged; check the cable and its shield")
        firmware, uid = controller.identity.firmware, controller.identity.uid
        return LedCheck(f"firmware {firmware}, id {uid}, at {controller.port}", figures)


def _flash(controller: LedController, leds: int, step_s: float, cycles: int) -> dict[str, float]:
    controller.start_cycle([*range(1, leds + 1), 0], step_s=step_s, on_s=0.6 * step_s)
    length = (leds + 1) * step_s
    first = controller.status()
    time.sleep(cycles * length)
    last = controller.status()
    if controller.recoveries or last.cycle <= first.cycle:
        raise InputError(f"{controller.port}: the controller was lost, or does not keep its cycle")
    round_trips = [controller.status().round_trip_s for _ in range(MEASURED_REQUESTS)]
    # Counted in steps, because both times are those of a step.
    steps = [status.cycle * (leds + 1) + status.step for status in (first, last)]
    step_us = (last.last_step_us - first.last_step_us) / (steps[1] - steps[0])
    return {
        "round_trip_ms": 1e3 * median(round_trips),
        "clock_error_ms": 1e3 * controller.clock_error_s,
        "jitter_ms": 1e3 * controller.jitter_s,
        "cycle_ms": 1e-3 * step_us * (leds + 1),
        "bad_lines": float(controller.faults["bad line"] + last.bad_lines),
    }
