"""The interface of a device's back end to planning and running."""

from __future__ import annotations

import importlib
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tactograph.graph.backends import BACKENDS
from tactograph.graph.backends.arrays import DeviceArray
from tactograph.graph.declare.engine_arguments import EVERYTHING, Wanted

if TYPE_CHECKING:
    from tactograph.graph.declare.node import Node


class Event(Protocol):
    """A point in a device's queue."""

    def wait(self) -> object:
        """Return once the device is past it."""
        ...


Timer = tuple[Any, Any]
"""The first and the last `Event` of a timed operation."""


class PreparedNode(Protocol):
    """A node's launch over arrays of known sizes."""

    @property
    def sizes(self) -> Mapping[str, int]: ...

    @property
    def shapes(self) -> dict[str, tuple[int, ...]] | None:
        """The outputs' shapes; None where one of them depends on the data."""
        ...

    def launch(self, inputs: Mapping[str, Any]) -> tuple[dict[str, DeviceArray], Timer]:
        """Enqueue the node; return its outputs, which are not ready yet."""
        ...


class DeviceBackend(Protocol):
    """One device with its queue, its buffers and its compiled nodes.

    Attributes
    ----------
    backend
        Its name in graph files.
    name
        The device's own name.
    driver
        Driver and version; another version may give other numbers.
    serial
        Unique identifier of this device, and its compiled kernels, within the process.
    error
        The exception type of the device's library.
    lanes
        Number of elements that a work-item does side by side.
    queue
        The library's own queue, for arrays that a caller makes there.
    poison
        Value of every byte of a fresh buffer, in tests.
    """

    backend: str
    name: str
    driver: str
    serial: str
    error: type[Exception]
    lanes: int
    is_cpu: bool
    queue: Any
    poison: int | None

    @property
    def buffers(self) -> int:
        """The number of buffers ever allocated."""
        ...

    def compile(self, nodes: Sequence[Node]) -> None:
        """Check nodes' kernels, and begin to compile them; each is there when it is launched."""
        ...

    def build(self, nodes: Sequence[Node]) -> int:
        """Compile nodes' kernels, but for those that need a launch, and count the programs."""
        ...

    def prepare(
        self,
        node: Node,
        settings: Mapping[str, Any],
        sizes: Mapping[str, int],
        wanted: Wanted = EVERYTHING,
    ) -> PreparedNode:
        """Work out a node's launch over arrays of the given sizes."""
        ...

    def upload(self, array: NDArray[Any]) -> DeviceArray: ...

    def start_upload(self, array: NDArray[Any]) -> tuple[DeviceArray, Timer]: ...

    def start_upload_of_fraction(self, array: NDArray[Any]) -> tuple[DeviceArray, Timer]: ...

    def copied(self, source: DeviceArray) -> DeviceArray: ...

    def lent(self, array: DeviceArray) -> Any:
        """An array of the device's library that holds the memory of another."""
        ...

    def stacked(self, arrays: Sequence[Any]) -> Any:
        """Arrays of the device's library, put together along a first axis."""
        ...

    def mapped(self, array: Any, name: str) -> NDArray[Any]:
        """An array of the device's library for the host, which on a CPU reads it where it lies.

        Raises
        ------
        InputError
            If this device cannot read it.
        """
        ...

    def adopted(self, array: Any) -> DeviceArray:
        """An array that was mapped, read where it lies if that can be."""
        ...

    def download(self, source: DeviceArray) -> NDArray[Any]: ...

    def start_download(self, source: DeviceArray) -> tuple[NDArray[Any], Timer]: ...

    def fill(self, shape: tuple[int, ...], dtype: np.dtype[Any], value: float) -> DeviceArray: ...

    def finish(self) -> None:
        """Wait for all that was enqueued."""
        ...

    def has_failed(self, timer: Timer) -> bool: ...

    def milliseconds(self, timer: Timer) -> float: ...

    def span(self, timer: Timer) -> tuple[float, float]:
        """Start and end, in seconds of the device's clock."""
        ...

    @property
    def clock_ahead(self) -> float:
        """Seconds by which the device's clock is ahead of `time.perf_counter`."""
        ...


def open_device(
    backends: Collection[str], text: str | None = None
) -> tuple[DeviceBackend | None, str]:
    """The first of these back ends whose device works, or None and the reason.

    Parameters
    ----------
    backends
        In order of preference.  If none of them has a device, `text` asks for any that has.
    text
        A part of the device's name.

    Raises
    ------
    InputError
        If `text` matches no device that works.
    """
    with_device = [name for name in BACKENDS if name != "numpy"]
    wanted = [name for name in backends if name in with_device]
    if not wanted and text is None:
        return None, f"{' or '.join(with_device)} is not among the preferred back ends"
    reasons = []
    for name in dict.fromkeys(wanted or with_device):
        module = importlib.import_module(f"tactograph.graph.backends.{name}")
        device, reason = module.open_device(text)
        if device is not None:
            return device, ""
        reasons.append(reason)
    return None, "; ".join(reasons)
