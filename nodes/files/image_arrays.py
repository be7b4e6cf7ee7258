"""Images that a caller hands in as arrays: the rule of image files holds for them too."""

from typing import Any

from numpy.typing import NDArray

from tactograph.graph import InputError
from tactograph.nodes.files.exposure import check_exposed

BIT_DEPTHS = (8, 10, 12, 14, 16)
"""Bits of a camera's values."""


def check_handed_in(stack: NDArray[Any], name: str) -> None:
    """Refuse images, K x H x W, that files could not hold, and give the same warnings as for files.

    Raises
    ------
    InputError
        If floats are no fractions of full scale, or an image is too dark to measure.
    """
    if stack.dtype.kind == "f":
        _check_fractions(stack, name)
    names = [f"{name}[{index}]" for index in range(len(stack))]
    check_exposed(stack, names, None, how_depth="hand in stack / np.float32({full})")


def _check_fractions(stack: NDArray[Any], name: str) -> None:
    low, high = float(stack.min()), float(stack.max())
    if low >= 0 and high <= 1:
        return
    full = next((2**bits - 1 for bits in BIT_DEPTHS if 2 < high <= 2**bits - 1), None)
    cure = (
        "np.clip(stack, 0, 1) cuts off what noise or resampling put outside"
        if full is None
        else f"divide by full scale: stack / {full} for {full.bit_length()} bit"
    )
    raise InputError(
        f"{name}: has values from {low:.4g} to {high:.4g}, but floats are fractions of full scale, "
        f"from 0 to 1; {cure}"
    )
