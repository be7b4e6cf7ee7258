"""Arrays as compiled loops take them."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Number = TypeVar("Number", bound=np.generic)


def only_read(array: NDArray[Number]) -> NDArray[Number]:
    """Return a contiguous, read-only array.

    Numba compiles a loop once for each kind of array; values in a graph are read-only, those that
    a caller passes to a node are not.
    """
    view = np.ascontiguousarray(array).view()
    view.flags.writeable = False
    return view
