"""Height maps in micrometres, as surfalize, a package for surface metrology, takes them."""

import importlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.sdk import Height, need
from tactograph.sdk.unstable import UM_PER_MM


def surfalize() -> Any:
    """The package, which takes seconds to load.

    Raises
    ------
    InputError
        If it is not installed.
    """
    need("metrology", "surface texture or a .sur file", "surfalize")
    return importlib.import_module("surfalize")


def areal_surface(height: Height, pixel: float, left_out: NDArray[np.bool_] | None = None) -> Any:
    """Return a ``surfalize.Surface`` of a height map in mm, with the points `left_out` masked."""
    return surfalize().Surface(
        UM_PER_MM * height.astype(np.float64), UM_PER_MM * pixel, UM_PER_MM * pixel, mask=left_out
    )
