"""Back ends of nodes: NumPy on the host, or one device.

NumPy is a plain call and needs no code here.  A device's back end NAME is the module NAME.py of
this folder with ``open_device(text, waits=…) -> (device | None, reason)``, and an entry below.
"""

from typing import Literal, get_args

Backend = Literal["numpy", "opencl"]
BACKENDS: tuple[Backend, ...] = get_args(Backend)
PREFERRED_ORDER: tuple[Backend, ...] = ("opencl", "numpy")
"""The order for a graph that states no preference."""
