"""How a node declares its OpenCL kernels: plain data, and where they can run."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol

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


@dataclass(frozen=True)
class Kernels:
    """What ``kernels/<name>.cl`` holds for a node; see `Node.opencl` for the fields."""

    grid: tuple[str, ...] | None = None
    lanes: Lanes | None = None
    whole: str | None = None
    launch: LaunchFunction | None = None
    requires: tuple[str, str] | None = None
    own_lanes: bool = False
    on_cpu: str | None = None
    source: str | os.PathLike[str] | None = None

    def uses_library(self, lanes: int) -> bool:
        """Whether the launch function needs its library on a device of so many lanes."""
        return self.requires is not None and not (self.own_lanes and lanes > 1)

    def can_run(self, device: DeviceTraits) -> str | None:
        """Why the kernels cannot run on a device, or None."""
        if self.requires is None or not self.uses_library(device.lanes):
            return None
        module, remedy = self.requires
        if importlib.util.find_spec(module) is None:
            return f"{module} is not installed ({remedy})"
        return None

    def better_on_host(self, device: DeviceTraits) -> str | None:
        """Why the NumPy function is the better one beside a device, or None."""
        return self.on_cpu if device.is_cpu else None
