"""A simulated LED controller: the firmware's own logic behind a pseudo-terminal.

It is opened and used like the board.  `tests/faulty.py` makes it fail.
"""

import contextlib
import os
import pty
import select
import threading
import time
import tty
from collections import deque

from tactograph.rings.live.firmware.controller import WRAP, Controller

MAX_REMEMBERED_STEPS = 8192
"""Number of LED changes that are kept for `SimulatedController.lit_between`."""
IDLE_S = 0.02
"""Longest period of the main loop in seconds."""
CLOCK_RATE = 1 + 2e-5
"""Seconds of its clock per second of the host's."""


class SimulatedController:
    """A controller with its board; `close` removes it.

    Parameters
    ----------
    leds : number of LEDs
    uid : the number of its chip

    Attributes
    ----------
    port : the pseudo-terminal
    """

    def __init__(self, leds: int = 4, *, uid: str = "e6614c311b000000") -> None:
        self._leds = leds
        self._uid = uid
        self._lock = threading.RLock()
        self._changes: deque[tuple[float, tuple[int, ...]]] = deque(maxlen=MAX_REMEMBERED_STEPS)
        self._closed = False
        self._open()
        self.port = os.ttyname(self._far)
        self._boot()
        self._thread = threading.Thread(target=self._run, name="simulated controller", daemon=True)
        self._thread.start()

    def lit_between(self, start: float, end: float) -> list[tuple[int, float]]:
        """LEDs that were lit between two past times of time.monotonic().

        Returns
        -------
        (LED, share) for each lit LED: the share of that time for which it was lit.
        """
        with self._lock:
            self._advance()
            changes = list(self._changes)
        light = [0.0] * (self._leds + 1)
        until = end
        for moment, levels in reversed(changes):
            lasted = until - max(moment, start)
            if lasted > 0:
                for led, is_lit in enumerate(levels):
                    light[led] += lasted * is_lit
                until = max(moment, start)
            if moment <= start:
                break
        return [(led, total / (end - start)) for led, total in enumerate(light) if total > 0]

    def close(self) -> None:
        """Stop and unplug it."""
        self._closed = True
        self._thread.join(2)
        self.halt()
        self._darken()
        for end in (self._main, self._far):
            os.close(end)

    # The board as the firmware sees it

    def ticks(self) -> int:
        """Microseconds since its start, modulo 2**30."""
        return round(1e6 * CLOCK_RATE * (self._now - self._born)) & WRAP

    def light(self, led: int, on: int) -> None:
        """Switch an LED on (1) or off (0)."""
        levels = list(self._changes[-1][1])
        levels[led] = on
        self._note(tuple(levels))

    def run(self, period_us: int, on_us: int, trigger_us: int) -> None:
        """Start the clock of steps."""
        self._step, self._on = (us / 1e6 / CLOCK_RATE for us in (period_us, on_us))
        self._next_step: float | None = self._now
        self._next_dark: float | None = None

    def halt(self) -> None:
        """Stop the clock of steps."""
        self._next_step = self._next_dark = None

    def send(self, data: bytes) -> None:
        """Send a line to the host."""
        # A full buffer means that nobody reads; the board drops lines then, too.
        with contextlib.suppress(BlockingIOError):
            os.write(self._main, data)

    # Simulation

    def _open(self) -> None:
        """Make a pseudo-terminal: our end and the host's."""
        self._main, self._far = pty.openpty()
        tty.setraw(self._far)
        os.set_blocking(self._main, False)

    def _boot(self) -> None:
        self._born = self._now = time.monotonic()
        self.halt()
        self._darken()
        self._controller = Controller(self, self._leds, self._uid)

    def _darken(self) -> None:
        self._now = time.monotonic()
        self._note((0,) * (self._leds + 1))

    def _note(self, levels: tuple[int, ...]) -> None:
        if not self._changes or self._changes[-1][1] != levels:
            self._changes.append((self._now, levels))

    def _advance(self) -> None:
        """Process everything that was due until now, each at its exact time."""
        now = time.monotonic()
        while (due := self._due()) <= now:
            self._now = due
            if due == self._next_dark:
                self._next_dark = None
                self._controller.dark()
            else:
                self._next_step = due + self._step
                self._next_dark = due + self._on if self._on < self._step else None
                self._controller.step()
        self._now = now

    def _due(self) -> float:
        return min((t for t in (self._next_dark, self._next_step) if t is not None), default=1e18)

    def _run(self) -> None:
        while not self._closed:
            with self._lock:
                self._advance()
                main, wait = self._main, min(IDLE_S, max(self._due() - self._now, 0))
                self._controller.poll()
            # The cable may be unplugged at any time.
            with contextlib.suppress(OSError):
                select.select([main], [], [], wait)
            with self._lock:
                self._advance()
                if self._main == main:
                    self._listen(main)

    def _listen(self, main: int) -> None:
        try:
            data = os.read(main, 4096)
        except OSError:
            return
        self._controller.receive(data)
