"""Stamps of messages: nanoseconds since 1970, of exposures on the camera's clock."""

import time as clock


class TouchStamps:
    """Converts the camera's clock, ``time.monotonic()``, to nanoseconds since 1970.

    Parameters
    ----------
    follow
        Whether stamps follow a time of day that is set while they are given, as on a computer
        that learns it from the network.  If not, as in a recording, they go on as they began.
    """

    def __init__(self, *, follow: bool = False) -> None:
        self._follow = follow
        self._offset = day_offset_ns()

    def of(self, time: float | None) -> int:
        """The stamp of an exposure; the present time if the exposure's is unknown."""
        if self._follow:
            self._offset = day_offset_ns()
        exposed = clock.monotonic_ns() if time is None else round(1e9 * time)
        return exposed + self._offset


def day_offset_ns() -> int:
    """What ``time.monotonic_ns()`` lacks to the nanoseconds since 1970."""
    return clock.time_ns() - clock.monotonic_ns()
