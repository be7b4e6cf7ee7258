"""How a node declares its OpenCL kernels: plain data, and where they can run."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol

LaunchFunction = Callable[[Any], None]
"""What is handed a `Launch`, for nodes of several launches."""
Lanes = Literal["grid", "rows"]
"""What a work-item goes along in steps of LANES: the whole grid, or one row of it."""


class DeviceTraits(Protocol):
    """What decides on a device whether a node's kernels run there."""

    @property
    def lanes(self) -> int: ...

    @property
    def is_cpu(self) -> bool: ...


class Obstacle(NamedTuple):
    """Why a node's kernels do not run on a device.

    Attributes
    ----------
    missing
        What they need and is not there, with the remedy; None if they could run.
    slower
        Why the NumPy function is the faster one beside this device; None if it is not.  The
        graph runs the node on NumPy then if it prefers numpy at all.
    """

    missing: str | None = None
    slower: str | None = None


CanRun = Callable[[DeviceTraits], Obstacle | None]


def can_run_anywhere(device: DeviceTraits) -> Obstacle | None:
    """No device is an obstacle."""
    return None


@dataclass(frozen=True)
class Kernels:
    """What ``kernels/ROOM/NAME.cl`` holds for a node; see `Node.opencl` for the fields."""

    grid: tuple[str, ...] | None = None
    lanes: Lanes | None = None
    whole: str | None = None
    launch: LaunchFunction | None = None
    can_run: CanRun = can_run_anywhere
    source: str | os.PathLike[str] | None = None
