"""The colours of pictures' labels, such as those of LEDs."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

BIT_COLOURS = (
    "#e6a03c", "#3c8fe6", "#d1495b", "#4caf7a", "#8e6bbf", "#c9c13b", "#5bc0be", "#b07d62",
)  # fmt: skip
NO_BIT_COLOUR, SEVERAL_COLOUR = "#f2f2f0", "#3a3a3a"


def label_colour(bits: int) -> str:
    """The colour of a label: of its bit, a dark one for several, near white for none."""
    if bits & (bits - 1):
        return SEVERAL_COLOUR
    return BIT_COLOURS[bits.bit_length() - 1] if bits else NO_BIT_COLOUR


def label_numbers(labels: NDArray[Any], count: int) -> NDArray[np.int64]:
    """0 where no bit is set, k for bit k alone, count + 1 for several."""
    bits = np.stack([(labels >> k) & 1 for k in range(count)]).astype(np.int64)
    single = (bits * np.arange(1, count + 1)[:, None, None]).sum(axis=0)
    return np.where(bits.sum(axis=0) > 1, count + 1, single)
