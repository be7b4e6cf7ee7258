"""Height maps in micrometres, as surfalize, a package for surface metrology, takes them."""

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.sdk import Height, need

METRES_PER_UM = 1e-6


def surfalize() -> Any:
    """The package, which takes seconds to load.

    Raises
    ------
    InputError
        If it is not installed.
    """
    need("metrology", "surface texture or a .sur file", "surfalize")
    return importlib.import_module("surfalize")


def areal_surface(height: Height, pixel: float, omitted: NDArray[np.bool_] | None = None) -> Any:
    """Return a ``surfalize.Surface`` of a height map in mm, with the points `omitted` masked."""
    return surfalize().Surface(
        1e3 * height.astype(np.float64), 1e3 * pixel, 1e3 * pixel, mask=omitted
    )


def surface_in_metres(file: Path) -> Sequence[Any]:
    """Width and length of a pixel, and the heights, of a file that surfalize reads."""
    surface = surfalize().Surface.load(str(file))
    return tuple(METRES_PER_UM * each for each in (surface.step_x, surface.step_y, surface.data))
