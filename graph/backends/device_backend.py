"""The device of a plan: which one, and its type for planning and running."""

import importlib
from collections.abc import Collection
from typing import TYPE_CHECKING, TypeAlias

from tactograph.graph.backends import BACKENDS

if TYPE_CHECKING:
    from tactograph.graph.backends.opencl import OpenCL

    DeviceBackend: TypeAlias = OpenCL
else:
    DeviceBackend = object  # pyopencl is not loaded if only NumPy runs


def open_device(
    backends: Collection[str], text: str | None = None, *, waits: bool = True
) -> tuple[DeviceBackend | None, str]:
    """Open the first back end whose device works; return None and the reason if none does.

    Parameters
    ----------
    backends
        In order of preference.  If none of them has a device, `text` asks for any that has.
    text
        A part of the device's name.
    waits
        Whether the caller waits if kernels have to be compiled first.

    Raises
    ------
    NotBuiltError
        If the caller does not wait, and no kernel is built; also when nodes are compiled.
    InputError
        If `text` matches no device that works.
    """
    with_device = [name for name in BACKENDS if name != "numpy"]
    names = [name for name in backends if name in with_device]
    if not names and text is None:
        return None, f"{' or '.join(with_device)} is not among the preferred back ends"
    reasons = []
    for name in dict.fromkeys(names or with_device):
        module = importlib.import_module(f"tactograph.graph.backends.{name}")
        device, reason = module.open_device(text, waits=waits)
        if device is not None:
            return device, ""
        reasons.append(reason)
    return None, "; ".join(reasons)
