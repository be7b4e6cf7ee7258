"""Back ends of nodes: NumPy on the host, which is a plain call, or OpenCL on one device."""

from typing import Literal, get_args

Backend = Literal["numpy", "opencl"]
BACKENDS: tuple[Backend, ...] = get_args(Backend)
PREFERRED_ORDER: tuple[Backend, ...] = ("opencl", "numpy")
"""The order for a graph that states no preference."""
