"""The host's side of the LED controller: find, command, watch, and find it again.

The protocol, the wiring and the firmware are described in rings/live/docs/hardware.md.

Long because every command must restore the same state after a lost connection.
"""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Self

from annotated_types import Interval
from pydantic import BaseModel, Field

from tactograph.rings.live.firmware.protocol import VERSION
from tactograph.rings.live.nodes.controller._led_clock import Clock, Course
from tactograph.rings.live.nodes.controller._led_line import MAX_NUMBER, Event, whole_number
from tactograph.rings.live.nodes.controller._led_link import (
    ControllerLostError,
    ControllerRefusedError,
    Link,
    Reply,
)
from tactograph.rings.live.nodes.controller._led_port import find_ports, no_controller, open_port
from tactograph.sdk import InputError, TactographError

FIRMWARE_NAME = "tactograph-led"
BEAT_S = 0.2
"""Seconds between two checks that the controller is present and in the requested state."""
RETRY_S = 0.1
"""Seconds between two attempts to find it again."""
TRIGGER_US = 100
"""Length of the trigger output's pulse, long enough for an opto-coupled camera input."""
MAX_CONTROLLER_LEDS = 255
"""Most LEDs that a controller may say it has."""
Count = Annotated[int, Interval(ge=0, le=MAX_NUMBER)]


@dataclass(frozen=True)
class Identity:
    """Identity of a controller: `uid` is its chip's unique number, `firmware` its release."""

    firmware: str
    leds: int
    uid: str


class Status(BaseModel, frozen=True):
    """State and counters of the controller, under their names in its answer.

    Attributes
    ----------
    state : "off", "set" or "cycle"
    led : the LED that is lit now, 0 if none
    step, cycle : position in the order and number of the cycle, both from 0; -1 outside a cycle
    last_step_us, time_us
        Start of that step, and present time, on the controller's clock in microseconds.
    bad_lines : number of damaged lines that the controller received
    round_trip_s : time from request to answer
    """

    state: str
    led: Annotated[int, Interval(ge=0, le=MAX_CONTROLLER_LEDS)]
    step: Annotated[int, Interval(ge=-1, le=MAX_NUMBER)]
    cycle: Annotated[int, Interval(ge=-1, le=MAX_NUMBER)]
    last_step_us: Annotated[Count, Field(alias="last")]
    time_us: Annotated[Count, Field(alias="t")]
    bad_lines: Annotated[Count, Field(alias="bad")]
    round_trip_s: float


def open_controller(
    port: str | None = None, *, timeout_s: float = 0.4, leds: int = 4, watchdog_s: float = 2.0
) -> LedController:
    """Find the LED controller, check its protocol, and switch its LEDs off.

    Parameters
    ----------
    port
        A serial port (``/dev/ttyACM0``, ``COM3``, a pseudo-terminal); None: the first
        controller found by its USB id.
    timeout_s : longest time that an answer may take
    leds : number of LEDs that are needed
    watchdog_s : silence of the host after which the controller switches its LEDs off

    Raises
    ------
    InputError
        In one line: no controller, no permission, port in use by another program, no or
        invalid answers, another protocol version, too few LEDs.
    """
    if port is not None:
        return LedController(port, timeout_s, leds, watchdog_s)
    ports = find_ports()
    if not ports:
        raise no_controller()
    for candidate in ports[:-1]:
        with contextlib.suppress(InputError):
            return LedController(candidate, timeout_s, leds, watchdog_s)
    return LedController(ports[-1], timeout_s, leds, watchdog_s)


class LedController:
    """A connected LED controller; `open_controller` creates it.

    Any thread may use it.  Its own thread monitors it: a lost controller is found again by its
    unique id on any port, and its state (LED or cycle) is restored.  Until then
    requests raise `ControllerLostError` and `step_at` returns None.  Leaving its ``with`` block,
    or `close`, switches the LEDs off.

    Attributes
    ----------
    port : where it was last found
    identity : its identity
    recoveries : for each loss or reset, the seconds until its state was restored
    """

    port: str
    identity: Identity
    recoveries: list[float]

    def __init__(self, port: str, timeout_s: float, leds: int, watchdog_s: float) -> None:
        self.port = port
        self.recoveries = []
        self._stated_port = port
        self._timeout = timeout_s
        self._watchdog = round(1000 * watchdog_s)
        self._clock = Clock()
        self._courses: deque[Course] = deque(maxlen=16)
        self._target: tuple[str, tuple[int, ...], float] = "off", (0,), math.inf
        """The request of the lasting state, and its LEDs and their step, as for `Course`."""
        self._faults: Counter[str] = Counter()
        self._news: deque[str] = deque(maxlen=100)
        self._state_lock = threading.RLock()
        self._request_lock = threading.RLock()
        self._woken = threading.Event()
        self._closed = threading.Event()
        self._failed_at: float | None = None
        self._link, self.identity = self._connect(port)
        try:
            if self.identity.leds < leds:
                raise InputError(
                    f"{port}: the controller has {self.identity.leds} LEDs, {leds} are needed"
                )
            self._restore()
        except TactographError as error:
            self._link.close()
            raise InputError(str(error)) from None
        except BaseException:
            self._link.close()
            raise
        # Some boards restart when their port is opened; that is not a fault.
        self._failed_at = None
        self._faults.clear()
        self._news.clear()
        self._keeper = threading.Thread(target=self._keep, name="LED keeper", daemon=True)
        self._keeper.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def connected(self) -> bool:
        """Tell if the controller is present and in the requested state."""
        return self._failed_at is None and not self._link.lost

    @property
    def faults(self) -> Counter[str]:
        """Counts of each fault: "controller lost", "controller reset", "bad line"…"""
        with self._state_lock:
            faults = Counter(self._faults)
            faults["bad line"] += self._link.bad
        return +faults

    @property
    def clock_error_s(self) -> float:
        """Largest timing error of `step_at`; infinite until the clock is known."""
        return self._clock.error

    @property
    def jitter_s(self) -> float:
        """Standard deviation of the transmission time of lines from the controller."""
        with self._state_lock:
            return self._clock.jitter()

    def news(self) -> list[str]:
        """Events since the last call, one line each."""
        return [self._news.popleft() for _ in range(len(self._news))]

    def set(self, led: int) -> None:
        """Light one LED, from 1, and no other; 0 is none.  This ends a cycle."""
        self._do(f"set {led}", (led,))

    def start_cycle(
        self, order: Sequence[int], *, step_s: float, on_s: float | None = None
    ) -> None:
        """Let the LEDs take turns, timed by the controller's hardware.

        The trigger output pulses at the start of each step.

        A controller that is lost meanwhile resumes the cycle once it is back.

        Parameters
        ----------
        order : LEDs from 1, one per step; 0 is a step in the dark
        step_s : duration of a step: the camera's frame time
        on_s
            How long an LED is lit from the start of its step.  None: until its end.
        """
        step = round(1e6 * step_s)
        on = step if on_s is None else round(1e6 * on_s)
        leds = ",".join(str(led) for led in order)
        cycle = f"cycle {leds} {step} {on} {TRIGGER_US}", tuple(order), 1e-6 * step
        try:
            self._do(*cycle)
        except ControllerLostError:
            self._target = cycle
            raise

    def status(self) -> Status:
        """Request the controller's state and counters."""
        reply = self._ask("status")
        about = {**reply.values, "round_trip_s": reply.received - reply.sent}
        with _intelligible():
            status = Status.model_validate(about)
        self._hear(1e-6 * status.time_us, reply.received, reply.sent)
        return status

    def step_at(self, host_time: float) -> int | None:
        """The LED whose turn it was at a time of time.monotonic(), 0 for none.

        If the on-time is shorter than the step, the LED may already be dark.  None if it is not
        known: no contact yet, controller lost, or the time is too long ago.  The times at which
        steps change are known to `clock_error_s`.
        """
        with self._state_lock:
            moment = self._clock.controller(host_time)
            if moment is None:
                return None
            for course in reversed(self._courses):
                if moment >= course.since:
                    return course.led(moment)
        return None

    def reconnect(self) -> bool:
        """Search once for this controller, on its port and all others; True if found.

        Its state is then restored.  There is no need to call this, because the monitoring thread
        searches ten times a second.
        """
        with self._request_lock:
            for port in dict.fromkeys([self._stated_port, self.port, *find_ports()]):
                try:
                    link, identity = self._connect(port)
                except TactographError:
                    continue
                if identity.uid != self.identity.uid:
                    link.close()
                    continue
                with self._state_lock:
                    before, self._link, self.port = self._link, link, port
                    self._faults["bad line"] += before.bad
                    self._forget()
                before.close()
                with contextlib.suppress(TactographError):
                    self._restore()
                    return True
            return False

    def close(self) -> None:
        """Switch the LEDs off and close the port."""
        if self._closed.is_set():
            return
        self._closed.set()
        self._woken.set()
        try:
            self._keeper.join(2)
            with contextlib.suppress(TactographError):
                self._link.request("off")
        finally:
            self._link.close()

    # Requests

    def _connect(self, port: str) -> tuple[Link, Identity]:
        link = Link(open_port(port, self._timeout), self._timeout, self._event, self._woken.set)
        try:
            return link, _identified(link, port, self._timeout)
        except BaseException:
            link.close()
            raise

    def _ask(self, body: str) -> Reply:
        with self._request_lock:
            return self._link.request(body)

    def _do(self, command: str, order: tuple[int, ...], step: float = math.inf) -> None:
        """Request a lasting state, and remember it for `_restore`."""
        with self._request_lock:
            reply = self._ask(command)
            self._target = command, order, step
            with self._state_lock, _intelligible():
                moment = 1e-6 * whole_number(reply.values["t"])
                if not self._hear(moment, reply.received, reply.sent):
                    raise ValueError
                # A cycle's first event later gives the exact start of its first step.
                self._courses.append(Course(moment, order, step, moment))

    def _restore(self) -> None:
        """Restore the controller's requested state."""
        self._ask(f"watchdog {self._watchdog}")
        self._do(*self._target)

    # Answers and events

    def _hear(self, moment: float, received: float, sent: float = -math.inf) -> bool:
        """Take in a time of the controller's clock; False if it contradicts those before."""
        with self._state_lock:
            if self._clock.hear(moment, received, sent):
                return True
            self._faults["clock jumped"] += 1
            self._news.append("the LED controller's clock contradicts its earlier answer")
            return False

    def _forget(self) -> None:
        self._clock.forget()
        self._courses.clear()

    def _event(self, event: Event, now: float) -> None:
        """Handle an event from the reading thread; one that violates the protocol is a bad line."""
        with self._state_lock:
            try:
                if event.name == "cycle":
                    began = 1e-6 * whole_number(event.words[1])
                    if self._hear(began, now) and self._courses:
                        self._courses[-1] = replace(self._courses[-1], start=began)
                elif event.name == "ready":
                    self._note_reset()
                    self._woken.set()
                elif event.name == "watchdog":
                    self._courses.append(Course(1e-6 * whole_number(event.words[0]), (0,)))
                    self._fail("host silent", "the LED controller heard nothing and switched off")
                    self._woken.set()
            except (ValueError, IndexError):
                self._faults["bad line"] += 1

    # Monitoring

    def _keep(self) -> None:
        while not self._closed.is_set():
            self._woken.wait(BEAT_S if self._failed_at is None else RETRY_S)
            self._woken.clear()
            if self._closed.is_set():
                return
            with self._request_lock:
                if self._look_after() and self._failed_at is not None:
                    with self._state_lock:
                        took = time.monotonic() - self._failed_at
                        self._failed_at = None
                        self.recoveries.append(took)
                        back = f"{self.port}: the LED controller is back after {took:.2f} s"
                        self._news.append(back)

    def _look_after(self) -> bool:
        """Check the controller, restore or find it if needed; whether it then is in order."""
        if not self._link.lost:
            try:
                if self._failed_at is None and self._does_what_it_should():
                    return True
                self._restore()
                return True
            except ControllerLostError:
                pass
            except ControllerRefusedError as error:
                self._fail("controller refuses", str(error))
                return False
        self._fail("controller lost", f"{self.port}: the LED controller is gone")
        with self._state_lock:
            self._forget()
        return self.reconnect()

    def _does_what_it_should(self) -> bool:
        status = self.status()
        command, (led, *_), _ = self._target
        state = "off" if command == "set 0" else command.split()[0]
        if status.state == state and (state != "set" or status.led == led):
            return True
        self._note_reset()
        return False

    def _note_reset(self) -> None:
        with self._state_lock:
            self._fail("controller reset", "the LED controller started anew")
            self._forget()

    def _fail(self, fault: str, line: str) -> None:
        with self._state_lock:
            if self._failed_at is None:
                self._failed_at = time.monotonic()
                self._faults[fault] += 1
                self._news.append(line)


@contextlib.contextmanager
def _intelligible() -> Iterator[None]:
    """Treat values that violate the protocol as no answer."""
    try:
        yield
    except (KeyError, ValueError):
        raise ControllerLostError("the LED controller's answer makes no sense") from None


def _identified(link: Link, port: str, timeout_s: float) -> Identity:
    """Identify the device at the other end.

    Raises
    ------
    InputError
        If it is not an LED controller, or has another protocol version.
    """
    try:
        values = link.request("id").values
    except ControllerRefusedError as error:
        raise InputError(f"{port}: {error}") from None
    except ControllerLostError:
        raise InputError(_no_answer(link, port, timeout_s)) from None
    protocol = values.get("protocol", "?")
    if values.get("name") != FIRMWARE_NAME:
        raise InputError(f"{port}: is {values.get('name', 'something')!r}, not an LED controller")
    if protocol != str(VERSION):
        raise InputError(
            f"{port}: the controller's firmware {values.get('firmware', '?')} speaks protocol "
            f"{protocol}, but {VERSION} is needed; put the one in firmware/ on it "
            "(rings/live/docs/hardware.md)"
        )
    try:
        leds = whole_number(values["leds"], 1, MAX_CONTROLLER_LEDS)
        return Identity(values["firmware"], leds, values["uid"])
    except (KeyError, ValueError):
        raise InputError(f"{port}: the controller does not say who it is") from None


def _no_answer(link: Link, port: str, timeout_s: float) -> str:
    if link.lost:
        return f"{port}: the connection broke at once; is the plug in well?"
    if link.bytes:
        return (
            f"{port}: what answers there is no LED controller, or has no firmware yet "
            "(rings/live/docs/hardware.md says how to put it on)"
        )
    return f"{port}: no answer within {timeout_s:g} s; is it an LED controller? unplug and replug"
