"""Convert host time to the controller's clock, and find which LED is lit then."""

import math
import statistics
from collections import deque
from dataclasses import dataclass

WINDOW_S = 10.0
"""Seconds for which bounds on the controller's clock are used."""
MAX_DRIFT = 1e-4
"""Two quartz clocks drift apart by less than this (100 ppm)."""
MAX_CONTRADICTION_S = 0.01
"""Seconds by which two bounds may contradict each other; clocks of poor boards drift more."""


class Clock:
    """Maps the controller's clock to time.monotonic(), in seconds.

    The controller reads its clock before its message arrives, and after a request was sent.
    Both facts bound the difference between the clocks.  The narrowest bounds of the last
    seconds, widened by the drift since, form an interval, whose middle is used.
    """

    def __init__(self) -> None:
        self._bounds: deque[tuple[float, float, float]] = deque(maxlen=256)
        self._difference: float | None
        self._doubted: bool
        self.error: float
        """Half the interval: the largest possible error."""
        self.forget()

    def hear(self, controller: float, received: float, sent: float = -math.inf) -> bool:
        """Note that the controller's clock showed `controller` between `sent` and `received`.

        Return False, and forget it, if the bounds of the last seconds contradict it.  If the
        next does so too, as after the host slept, they are forgotten instead.
        """
        bounds = self._bounds
        while bounds and received - bounds[0][0] > WINDOW_S:
            bounds.popleft()
        bounds.append((received, sent - controller, received - controller))
        low = max(b[1] - MAX_DRIFT * (received - b[0]) for b in bounds)
        high = min(b[2] + MAX_DRIFT * (received - b[0]) for b in bounds)
        if low - high > MAX_CONTRADICTION_S:
            newest = bounds.pop()
            if not self._doubted:
                self._doubted = True
                return False
            self.forget()
            bounds.append(newest)
            _, low, high = newest
        self._doubted = False
        if math.isfinite(low):
            self._difference = (low + high) / 2
            self.error = abs(high - low) / 2
        return True

    def controller(self, host: float) -> float | None:
        """The controller's time at a time of time.monotonic(); None until it is known."""
        return None if self._difference is None else host - self._difference

    def jitter(self) -> float:
        """Standard deviation of the controller's transmission times, in s."""
        late = [b[2] for b in self._bounds]
        return statistics.pstdev(late) if len(late) > 1 else math.nan

    def forget(self) -> None:
        """Start again, after the controller was switched off or replaced."""
        self._bounds.clear()
        self._difference = None
        self._doubted = False
        self.error = math.inf


@dataclass(frozen=True)
class Course:
    """LEDs that take turns from `since` on, `step` seconds each; in controller time."""

    since: float
    order: tuple[int, ...]
    step: float = math.inf
    start: float = 0.0

    def led(self, time: float) -> int:
        """The LED whose turn it is, 0 if none is lit."""
        if math.isinf(self.step):
            return self.order[0]
        return self.order[math.floor((time - self.start) / self.step) % len(self.order)]
