"""Back ends of nodes: NumPy on the host, or one device.

NumPy is a plain call and needs no code here.  A device back end NAME is a module NAME.py in this
folder with ``open_device(text, waits=…) -> (device | None, reason)``, and an entry below.
"""

from typing import Literal, get_args

Backend = Literal["numpy", "opencl"]
BACKENDS: tuple[Backend, ...] = get_args(Backend)
PREFERRED_ORDER: tuple[Backend, ...] = ("opencl", "numpy")
"""The order for a graph that states no preference."""
