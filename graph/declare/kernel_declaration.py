"""The declaration of a node's OpenCL kernels, and of where they can run."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol

LaunchFunction = Callable[[Any], None]
"""A function that takes a `Launch`, for nodes of several launches."""
Lanes = Literal["grid", "rows"]
"""The range that a work-item covers in steps of LANES: the whole grid, or one row of it."""


class DeviceTraits(Protocol):
    """The properties of a device that decide whether a node's kernels run there."""

    @property
    def lanes(self) -> int: ...

    @property
    def is_cpu(self) -> bool: ...


class Obstacle(NamedTuple):
    """Why a node's kernels do not run on a device.

    `missing` is a requirement that is not met, with the remedy.  `slower` says why the NumPy
    function is faster than this device; the node then runs on NumPy if the graph prefers numpy at
    all.
    """

    missing: str | None = None
    slower: str | None = None


CanRun = Callable[[DeviceTraits], Obstacle | None]


def can_run_anywhere(device: DeviceTraits) -> Obstacle | None:
    """Accept every device."""
    return None


@dataclass(frozen=True)
class Kernels:
    """The kernels of a node in ``kernels/ROOM/NAME.cl``; see `Node.opencl` for the fields."""

    grid: tuple[str, ...] | None = None
    lanes: Lanes | None = None
    integers: str | None = None
    launch: LaunchFunction | None = None
    can_run: CanRun = can_run_anywhere
    source: str | os.PathLike[str] | None = None
