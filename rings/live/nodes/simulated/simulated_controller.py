"""A simulated LED controller: the firmware's own logic behind a pseudo-terminal.

It is found, opened and used like the board, and can simulate its faults.
"""

import contextlib
import fcntl
import os
import pty
import select
import threading
import time
import tty
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Self

from tactograph.rings.live.firmware.controller import WRAP, Controller

MAX_REMEMBERED_STEPS = 8192
"""Number of LED changes that are kept for `SimulatedController.lit_between`."""
IDLE_S = 0.02
"""Longest period of the main loop in seconds."""


class SimulatedController:
    """A controller with its board, connected from the start; `close` removes it.

    Parameters
    ----------
    leds : number of LEDs
    uid : the number of its chip
    drift : relative excess speed of its clock
    protocol : the protocol version that it reports
    link : a path that always points to its port, like a link made by a udev rule

    Attributes
    ----------
    port : the pseudo-terminal; another one after `replug`
    burnt_out : LEDs that give no light
    garble : changes each line on its way to the host; None: lines arrive unchanged
    """

    def __init__(
        self,
        leds: int = 4,
        *,
        uid: str = "e6614c311b000000",
        drift: float = 2e-5,
        protocol: int | None = None,
        link: Path | None = None,
    ) -> None:
        self.port = ""
        self.burnt_out: set[int] = set()
        self.garble: Callable[[bytes], bytes] | None = None
        self._leds = leds
        self._uid = uid
        self._drift = drift
        self._protocol = protocol
        self._link = link
        self._lock = threading.RLock()
        self._changes: deque[tuple[float, tuple[int, ...]]] = deque(maxlen=MAX_REMEMBERED_STEPS)
        self._closed = False
        self._main: int | None = None
        self._far: int | None = None
        self._plug_in()
        self._thread = threading.Thread(target=self._run, name="simulated controller", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

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

    @property
    def asked_to_quit(self) -> bool:
        """Tell if the host has asked the firmware to end."""
        with self._lock:
            return self._controller.asked_to_quit

    # Faults

    def unplug(self) -> None:
        """Pull its cable: no port and no power."""
        with self._lock:
            self._advance()
            self._darken()
            for end in (self._main, self._far):
                if end is not None:
                    os.close(end)
            self._main = self._far = None
            if self._link is not None:
                self._link.unlink(missing_ok=True)

    def replug(self) -> None:
        """Plug it in again; it restarts on another port."""
        with self._lock:
            self._plug_in()

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
            self._write(data)

    @contextlib.contextmanager
    def taken(self) -> Iterator[None]:
        """Let another program hold the port during the block."""
        other = os.open(self.port, os.O_RDWR | os.O_NOCTTY)
        fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
        try:
            yield
        finally:
            os.close(other)

    def close(self) -> None:
        """Stop and unplug it."""
        self._closed = True
        self._thread.join(2)
        self.unplug()

    # The board as the firmware sees it

    def ticks(self) -> int:
        """Microseconds since its start, modulo 2**30."""
        return round(1e6 * (1 + self._drift) * (self._now - self._born)) & WRAP

    def light(self, led: int, on: int) -> None:
        """Switch an LED on (1) or off (0)."""
        levels = list(self._changes[-1][1])
        levels[led] = 0 if led in self.burnt_out else on
        self._note(tuple(levels))

    def run(self, period_us: int, on_us: int, trigger_us: int) -> None:
        """Start the clock of steps."""
        self._step, self._on = (us / 1e6 / (1 + self._drift) for us in (period_us, on_us))
        self._next_step: float | None = self._now
        self._next_dark: float | None = None

    def halt(self) -> None:
        """Stop the clock of steps."""
        self._next_step = self._next_dark = None

    def send(self, data: bytes) -> None:
        """Send a line to the host."""
        self._write(data if self.garble is None else self.garble(data))

    # Simulation

    def _plug_in(self) -> None:
        main, far = pty.openpty()
        if os.ttyname(far) == self.port:
            same = main, far
            main, far = pty.openpty()
            for end in same:
                os.close(end)
        tty.setraw(far)
        os.set_blocking(main, False)
        self._main, self._far = main, far
        self.port = os.ttyname(far)
        if self._link is not None:
            self._link.unlink(missing_ok=True)
            self._link.symlink_to(self.port)
        self._boot()

    def _boot(self) -> None:
        self._born = self._now = time.monotonic()
        self._frozen_until = 0.0
        self.halt()
        self._darken()
        self._controller = Controller(self, self._leds, self._uid)
        if self._protocol is not None:
            self._controller.protocol = self._protocol

    def _darken(self) -> None:
        self._now = time.monotonic()
        self._note((0,) * (self._leds + 1))

    def _note(self, levels: tuple[int, ...]) -> None:
        if not self._changes or self._changes[-1][1] != levels:
            self._changes.append((self._now, levels))

    def _write(self, data: bytes) -> None:
        if self._main is not None:
            # A full buffer means that nobody reads; the board drops lines then, too.
            with contextlib.suppress(BlockingIOError):
                os.write(self._main, data)

    def _advance(self) -> None:
        """Process everything that was due until now, each at its exact time."""
        now = time.monotonic()
        if self._main is None or now < self._frozen_until:
            return
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
                if main is not None:
                    self._controller.poll()
            if main is None:
                time.sleep(IDLE_S)
                continue
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
        if self._now >= self._frozen_until:
            self._controller.receive(data)
