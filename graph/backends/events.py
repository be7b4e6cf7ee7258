"""Events of a device: when something ended there, how long it took, whether it failed."""

from __future__ import annotations

from typing import Any

import pyopencl as cl

Event = cl.Event
Timer = tuple[cl.Event, cl.Event]
"""The first and the last event of something that is timed."""
DEVICE_ERROR = cl.Error
"""What the device's own errors are."""


def has_failed(timer: Timer) -> bool:
    """Whether what the two events stand for ended in an error."""
    try:
        return any(event.command_execution_status < 0 for event in timer)
    except cl.Error:
        return True


def span(timer: Timer) -> tuple[float, float]:
    """When the first event began and the last one ended, in seconds of the device's clock."""
    first, last = timer
    start: Any = first.get_profiling_info(cl.profiling_info.START)
    end: Any = last.get_profiling_info(cl.profiling_info.END)
    return 1e-9 * start, 1e-9 * end


def milliseconds(timer: Timer) -> float:
    """The time between the start of the first event and the end of the last, on the device."""
    first, last = timer
    # Twice as fast as the attribute `profile`.
    start: Any = first.get_profiling_info(cl.profiling_info.START)
    end: Any = last.get_profiling_info(cl.profiling_info.END)
    return float(end - start) * 1e-6
