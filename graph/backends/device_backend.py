"""The device of a plan: which one, and its type for planning and running."""

from collections.abc import Collection
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from tactograph.graph.backends.opencl import OpenCL

    DeviceBackend: TypeAlias = OpenCL
else:
    DeviceBackend = object  # pyopencl is not loaded if only NumPy runs


def open_device(
    backends: Collection[str], text: str | None = None, *, waits: bool = True
) -> tuple[DeviceBackend | None, str]:
    """Open the device of the preferred back ends; return None and the reason if there is none.

    Parameters
    ----------
    backends
        Those that are preferred.
    text
        A part of the device's name, which asks for a device even if none of them has one.
    waits
        Whether the caller waits if kernels have to be compiled first.

    Raises
    ------
    NotBuiltError
        If the caller does not wait, and no kernel is built; also when nodes are compiled.
    InputError
        If `text` matches no device that works.
    """
    if "opencl" not in backends and text is None:
        return None, "opencl is not among the preferred back ends"
    from tactograph.graph.backends import opencl

    return opencl.open_device(text, waits=waits)
