"""The LED controller as the host sees it: found, commanded, watched, and found again.

The protocol, the wiring and the firmware are described in docs/hardware.md.

Long because every command has to restore the same state after a lost connection.
"""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

from tactograph.graph import InputError, TactographError
from tactograph.nodes.live._led_clock import Clock, Course
from tactograph.nodes.live._led_line import PROTOCOL, Event
from tactograph.nodes.live._led_link import ControllerLostError, ControllerRefusedError, Heard, Link
from tactograph.nodes.live._led_port import find_ports, holder, no_controller, open_port

__all__ = [
    "ControllerLostError",
    "ControllerRefusedError",
    "Identity",
    "LedController",
    "Status",
    "open_controller",
]

NAME = "tactograph-led"
BEAT = 0.2
"""Seconds between two looks at whether the controller is there and does what it should."""
RETRY = 0.1
"""Seconds between two attempts to find it again."""
FULL = 1000


@dataclass(frozen=True)
class Identity:
    """Who a controller is: `uid` is its chip's own number, `firmware` its release."""

    protocol: int
    firmware: str
    leds: int
    uid: str


@dataclass(frozen=True)
class Status:
    """What the controller does and has counted.

    Attributes
    ----------
    state
        "off", "set" or "cycle".
    led
        The LED that is lit at this moment, 0 if none.
    step, cycle
        Place in the order, from 0, and number of the cycle, from 0; -1 outside a cycle.
    last_step_us, time_us
        When that step began, and now, by the controller's clock in microseconds.
    bad_lines
        Lines that reached the controller damaged.
    watchdog
        How often it switched off because the host was silent.
    burnt_out
        LEDs through which no current flows; None where the board does not measure it.
    round_trip_s
        How long this answer took.
    """

    state: str
    led: int
    step: int
    cycle: int
    last_step_us: int
    time_us: int
    bad_lines: int
    watchdog: int
    burnt_out: tuple[int, ...] | None
    round_trip_s: float


def open_controller(
    port: str | None = None,
    *,
    timeout_s: float = 0.4,
    leds: int = 4,
    watchdog_s: float = 2.0,
) -> LedController:
    """Find the LED controller, make sure that it understands us, and switch its LEDs off.

    Parameters
    ----------
    port
        A serial port (``/dev/ttyACM0``, ``COM3``, a pseudo-terminal); None: the first
        controller found by its USB id.
    timeout_s
        How long an answer may take.
    leds
        How many LEDs are needed.
    watchdog_s
        The controller switches its LEDs off once the host has been silent for so long.

    Raises
    ------
    InputError
        In one line: no controller there, no permission, the port taken by another program,
        no or unintelligible answers, another protocol version, too few LEDs.
    """
    if port is not None:
        return LedController(port, timeout_s, leds, watchdog_s)
    found = find_ports()
    if not found:
        raise no_controller()
    for i, candidate in enumerate(found):
        try:
            return LedController(candidate, timeout_s, leds, watchdog_s)
        except InputError:
            if i == len(found) - 1:
                raise
    raise AssertionError


class LedController:
    """A connected LED controller; `open_controller` makes it.

    Any thread may use it.  A thread of its own looks after it: what fails is found again by
    its unique id, on whatever port, and does again what it did (brightness, LED or cycle).
    Until then requests raise `ControllerLostError` and `step_at` says None.  Leaving its ``with``
    block, or `close`, switches the LEDs off.

    Attributes
    ----------
    port
        Where it was found last.
    identity
        Who it is.
    recoveries
        For each time it was lost or reset, the seconds until it did again what it should.
    """

    port: str
    identity: Identity
    recoveries: list[float]

    def __init__(self, port: str, timeout_s: float, leds: int, watchdog_s: float) -> None:
        self.port = port
        self.recoveries = []
        self._given = port
        self._timeout = timeout_s
        self._watchdog = round(1000 * watchdog_s)
        self._clock = Clock()
        self._courses: deque[Course] = deque(maxlen=16)
        self._levels: dict[int, int] = {}
        self._wish = "off"
        self._faults: Counter[str] = Counter()
        self._news: deque[str] = deque(maxlen=100)
        self._known = threading.RLock()
        self._commands = threading.RLock()
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
        # Some boards start anew when their port is opened; that is no fault.
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
        """Whether it is there and does what it should."""
        return self._failed_at is None and not self._link.lost

    @property
    def faults(self) -> Counter[str]:
        """How often what happened: "controller lost", "controller reset", "bad line"…"""
        with self._known:
            faults = Counter(self._faults)
            faults["bad line"] += self._link.bad
        return +faults

    @property
    def clock_error_s(self) -> float:
        """By how much `step_at` may be wrong in time, at most; infinite before it knows."""
        return self._clock.error

    @property
    def jitter_s(self) -> float:
        """Standard deviation of the time that lines from the controller are under way."""
        with self._known:
            return self._clock.jitter()

    def news(self) -> list[str]:
        """What happened since this was last asked, a line each."""
        return [self._news.popleft() for _ in range(len(self._news))]

    def set(self, led: int) -> None:
        """Light one LED, from 1, and no other; 0 is none."""
        self._do(f"set {led}", (led,))

    def off(self) -> None:
        """All LEDs off; a cycle ends."""
        self._do("off", (0,))

    def stop(self) -> None:
        """End the cycle; all LEDs are off then."""
        self.off()

    def brightness(self, led: int, share: float) -> None:
        """Set how bright an LED is when it is lit, 0 to 1, in thousandths."""
        level = round(FULL * share)
        with self._commands:
            self._ask(f"level {led} {level}")
            self._levels[led] = level

    def start_cycle(
        self,
        order: Sequence[int],
        *,
        step_s: float,
        on_s: float | None = None,
        trigger_s: float = 0.0,
    ) -> None:
        """Let the LEDs take turns, timed by the controller's hardware.

        A controller that is lost meanwhile takes the cycle up once it is back.

        Parameters
        ----------
        order
            LEDs from 1, one per step; 0 is a step in the dark.
        step_s
            Duration of a step: the camera's frame time.
        on_s
            For how long an LED is lit from the start of its step; None: until its end.
        trigger_s
            Length of the pulse on the trigger output at the start of each step; 0: none.
        """
        step = round(1e6 * step_s)
        on = step if on_s is None else round(1e6 * on_s)
        leds = ",".join(str(led) for led in order)
        wish = f"cycle {leds} {step} {on} {round(1e6 * trigger_s)}"
        try:
            self._do(wish, tuple(order), 1e-6 * step)
        except ControllerLostError:
            self._wish = wish
            raise

    def status(self) -> Status:
        """Ask the controller what it does and has counted."""
        heard = self._ask("status")
        with _intelligible():
            status = _status(heard)
        self._hear(heard)
        return status

    def step_at(self, host_time: float) -> int | None:
        """The LED whose turn it was at a moment of time.monotonic(), 0 for none.

        Within a step the LED may already be dark again, where the on-time is shorter.  None if
        it is not known: no contact yet, lost, or the moment is too long ago.  The moment at
        which steps change is known to `clock_error_s`.
        """
        with self._known:
            moment = self._clock.controller(host_time)
            if moment is None:
                return None
            for course in reversed(self._courses):
                if moment >= course.since:
                    return course.led(moment)
        return None

    def reconnect(self) -> bool:
        """Look once for this very controller, on its port and on all others; True if found.

        It then does again what it did.  There is no need to call this: the controller looks
        for itself ten times a second.
        """
        with self._commands:
            for port in dict.fromkeys([self._given, self.port, *find_ports()]):
                try:
                    link, identity = self._connect(port)
                except TactographError:
                    continue
                if identity.uid != self.identity.uid:
                    link.close()
                    continue
                with self._known:
                    before, self._link, self.port = self._link, link, port
                    self._faults["bad line"] += before.bad
                    self._forget()
                before.close()
                with contextlib.suppress(TactographError):
                    self._restore()
                    return True
            return False

    def close(self) -> None:
        """Switch the LEDs off and leave the port."""
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

    # Asking

    def _connect(self, port: str) -> tuple[Link, Identity]:
        link = Link(open_port(port, self._timeout), self._timeout, self._event, self._woken.set)
        try:
            return link, _identified(link, port, self._timeout)
        except BaseException:
            link.close()
            raise

    def _ask(self, body: str) -> Heard:
        with self._commands:
            return self._link.request(body)

    def _do(self, wish: str, order: tuple[int, ...], step: float = math.inf) -> None:
        """Ask for a state that lasts, and keep in mind that it is wanted."""
        with self._commands:
            heard = self._ask(wish)
            self._wish = wish
            with _intelligible():
                moment = 1e-6 * int(heard.values["t"])
            with self._known:
                self._hear(heard)
                # A cycle's first event says exactly when its first step began.
                self._courses.append(Course(moment, order, step, moment))

    def _restore(self) -> None:
        """Have the controller do what it should."""
        self._ask(f"watchdog {self._watchdog}")
        for led, level in self._levels.items():
            self._ask(f"level {led} {level}")
        verb, *words = self._wish.split()
        if verb != "cycle":
            self._do(self._wish, (int(words[0]) if words else 0,))
            return
        order = tuple(int(word) for word in words[0].split(","))
        self._do(self._wish, order, 1e-6 * int(words[1]))

    # Hearing

    def _hear(self, heard: Heard) -> None:
        with self._known, _intelligible():
            self._clock.hear(1e-6 * int(heard.values["t"]), heard.received, heard.sent)

    def _forget(self) -> None:
        self._clock.forget()
        self._courses.clear()

    def _event(self, event: Event, now: float) -> None:
        """What the reading thread hears unasked."""
        with contextlib.suppress(ValueError, IndexError), self._known:
            if event.name == "cycle":
                began = 1e-6 * int(event.words[1])
                self._clock.hear(began, now)
                if self._courses:
                    self._courses[-1] = self._courses[-1].moved(began)
            elif event.name == "ready":
                self._fail("controller reset", "the LED controller started anew")
                self._forget()
                self._woken.set()
            elif event.name == "watchdog":
                self._courses.append(Course(1e-6 * int(event.words[0]), (0,)))
                self._fail("host silent", "the LED controller heard nothing and switched off")
                self._woken.set()

    # Looking after it

    def _keep(self) -> None:
        while not self._closed.is_set():
            self._woken.wait(BEAT if self._failed_at is None else RETRY)
            self._woken.clear()
            if self._closed.is_set():
                return
            with self._commands:
                if self._look_after():
                    self._mended()

    def _look_after(self) -> bool:
        """Whether the controller is there and does what it should, if need be by mending."""
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
        with self._known:
            self._forget()
        return self.reconnect()

    def _does_what_it_should(self) -> bool:
        status = self.status()
        wanted = self._wish.split()
        state = "off" if wanted == ["set", "0"] else wanted[0]
        if status.state == state and (state != "set" or status.led == int(wanted[1])):
            return True
        self._fail("controller reset", "the LED controller started anew")
        with self._known:
            self._forget()
        return False

    def _fail(self, fault: str, line: str) -> None:
        with self._known:
            if self._failed_at is None:
                self._failed_at = time.monotonic()
                self._faults[fault] += 1
                self._news.append(line)

    def _mended(self) -> None:
        with self._known:
            if self._failed_at is not None:
                took = time.monotonic() - self._failed_at
                self._failed_at = None
                self.recoveries.append(took)
                self._news.append(f"{self.port}: the LED controller is back after {took:.2f} s")


@contextlib.contextmanager
def _intelligible() -> Iterator[None]:
    """Values that are not as the protocol has them count as no answer."""
    try:
        yield
    except (KeyError, ValueError):
        raise ControllerLostError("the LED controller's answer makes no sense") from None


def _identified(link: Link, port: str, timeout_s: float) -> Identity:
    """Who is at the other end.

    Raises
    ------
    InputError
        If it is no LED controller, or one that speaks another version.
    """
    try:
        values = link.request("id").values
    except ControllerRefusedError as error:
        raise InputError(f"{port}: {error}") from None
    except ControllerLostError:
        raise InputError(_no_answer(link, port, timeout_s)) from None
    protocol = values.get("protocol", "?")
    if values.get("name") != NAME:
        raise InputError(f"{port}: is {values.get('name', 'something')!r}, not an LED controller")
    if protocol != str(PROTOCOL):
        raise InputError(
            f"{port}: the controller's firmware {values.get('firmware', '?')} speaks protocol "
            f"{protocol}, but {PROTOCOL} is needed; put the one in firmware/ on it "
            "(docs/hardware.md)"
        )
    try:
        return Identity(PROTOCOL, values["firmware"], int(values["leds"]), values["uid"])
    except (KeyError, ValueError):
        raise InputError(f"{port}: the controller does not say who it is") from None


def _no_answer(link: Link, port: str, timeout_s: float) -> str:
    if link.lost:
        return f"{port}: the connection broke at once; is the plug in well?"
    if link.bytes:
        return (
            f"{port}: what answers there is no LED controller, or has no firmware yet "
            "(docs/hardware.md says how to put it on)"
        )
    other = holder(port)
    if other:
        return f"{port}: no answer within {timeout_s:g} s; {other} has it open too, close that"
    return f"{port}: no answer within {timeout_s:g} s; is it an LED controller? unplug and replug"


def _status(heard: Heard) -> Status:
    value = heard.values
    burnt = value["open"]
    return Status(
        state=value["state"],
        led=int(value["led"]),
        step=int(value["step"]),
        cycle=int(value["cycle"]),
        last_step_us=int(value["last"]),
        time_us=int(value["t"]),
        bad_lines=int(value["bad"]),
        watchdog=int(value["bitten"]),
        burnt_out=None if burnt == "-" else _leds(burnt),
        round_trip_s=heard.received - heard.sent,
    )


def _leds(words: str) -> tuple[int, ...]:
    return () if words == "none" else tuple(int(word) for word in words.split(","))
