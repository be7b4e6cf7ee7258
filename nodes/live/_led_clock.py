"""What the controller's clock shows at a moment of the host's, and which LED is lit then."""

from __future__ import annotations

import math
import statistics
from collections import deque
from dataclasses import dataclass, replace

WINDOW = 10.0
"""Seconds for which what was heard of the controller's clock counts."""
DRIFT = 1e-4
"""Two quartz clocks drift apart by less than this (100 ppm)."""


class Clock:
    """Maps the controller's clock to time.monotonic(), in seconds.

    Whatever the controller tells of its time was true before it came, and an answer was given
    after its request was sent.  Each of these bounds the difference between the two clocks;
    the narrowest bounds of the last seconds, widened by the drift since, leave an interval
    whose middle is taken.
    """

    def __init__(self) -> None:
        self._bounds: deque[tuple[float, float, float]] = deque(maxlen=256)
        self._difference: float | None = None
        self.error = math.inf
        """Half the interval that is left: the error at most."""

    def hear(self, controller: float, received: float, sent: float = -math.inf) -> None:
        """Take in that the controller's clock showed `controller` between two moments."""
        bounds = self._bounds
        bounds.append((received, sent - controller, received - controller))
        while received - bounds[0][0] > WINDOW:
            bounds.popleft()
        low = max(b[1] - DRIFT * (received - b[0]) for b in bounds)
        high = min(b[2] + DRIFT * (received - b[0]) for b in bounds)
        if math.isfinite(low):
            self._difference = (low + high) / 2
            self.error = abs(high - low) / 2

    def controller(self, host: float) -> float | None:
        """The controller's time at a moment of time.monotonic(); None before it is known."""
        return None if self._difference is None else host - self._difference

    def jitter(self) -> float:
        """Standard deviation of how long what the controller tells is under way, in s."""
        late = [b[2] for b in self._bounds]
        return statistics.pstdev(late) if len(late) > 1 else math.nan

    def forget(self) -> None:
        """Start anew: the controller has been switched off, or another one came."""
        self._bounds.clear()
        self._difference = None
        self.error = math.inf


@dataclass(frozen=True)
class Course:
    """LEDs that take turns from `since` on, `step` seconds each; times by the controller."""

    since: float
    order: tuple[int, ...]
    step: float = math.inf
    start: float = 0.0

    def led(self, time: float) -> int:
        """The LED whose turn it is, 0 if none is lit."""
        if math.isinf(self.step):
            return self.order[0]
        return self.order[math.floor((time - self.start) / self.step) % len(self.order)]

    def moved(self, start: float) -> Course:
        """The same, a cycle of it having begun at `start`."""
        return replace(self, start=start)
