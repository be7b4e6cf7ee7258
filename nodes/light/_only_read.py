"""Arrays as loops that are compiled take them."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Number = TypeVar("Number", bound=np.generic)


def only_read(array: NDArray[Number]) -> NDArray[Number]:
    """Return an array without gaps that nobody writes to.

    Numba compiles a loop once for each kind of array; values of a graph are read-only, those of a
    caller of the node are not.
    """
    view = np.ascontiguousarray(array).view()
    view.flags.writeable = False
    return view
