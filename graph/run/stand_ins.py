"""Arrays that a caller hands in for source nodes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.graph.errors import InputError, message_of
from tactograph.graph.plan.plan import Plan
from tactograph.graph.run.whole_images import as_fractions

MAX_LIGHTS = 32
"""A stack of more images is taken for the rows of one image."""


class StandIns:
    """The source nodes that a caller stands in for."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._waiting = {task.id for task in plan.tasks.values() if task.stand_in}

    @property
    def names(self) -> list[str]:
        """The nodes that wait for an array, by name."""
        return sorted(self._waiting)

    def check(self, arrays: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
        """The caller's arrays as stacks of images, as views where possible.

        Raises
        ------
        InputError
            If one is missing, unknown, or no stack of images.
        """
        if self._waiting != arrays.keys():
            raise InputError(
                f"{self._plan.graph.name}: arrays are needed for {self.names}, "
                f"and were given for {sorted(arrays)}"
            )
        return {name: self._checked(name, array).view() for name, array in arrays.items()}

    def _checked(self, name: str, array: Any) -> NDArray[Any]:
        """A stack K x H x W: 8 or 16 bits stay as they are, all else becomes float32."""
        stack = _images(array)
        check = self._plan.tasks[name].node.check_handed_in
        if check is not None:
            check(stack, name)
        if stack.dtype in (np.uint8, np.uint16):
            return stack
        return as_fractions(stack) if stack.dtype.kind == "u" else np.asarray(stack, np.float32)

    def item(self, stacks: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
        """The items that the nodes would have yielded."""
        return {name: self._yielded(name, stack) for name, stack in stacks.items()}

    def _yielded(self, name: str, stack: NDArray[Any]) -> Any:
        record = self._plan.tasks[name].node.output_record
        return stack if record is None else record(stack)


def _images(array: Any) -> NDArray[Any]:
    """A stack K x H x W of unsigned integers or finite floats."""
    if np.ma.is_masked(array):
        raise InputError("a stack of images has no masked pixels; stack.data holds all of them")
    try:
        stack = np.asarray(array)
    except Exception as error:  # whatever an object's own __array__ raises
        raise InputError(
            f"no stack of images can be made of {type(array).__name__}: {message_of(error)}"
        ) from error
    if stack.ndim == 3 and stack.shape[2] <= MAX_LIGHTS < stack.shape[0]:
        raise InputError(
            f"a stack of images is K x H x W; {stack.shape} looks like H x W x K: "
            "np.moveaxis(stack, -1, 0) puts the lights first"
        )
    if stack.ndim == 4 and stack.shape[3] in (3, 4):
        raise InputError(
            f"a stack of images is K x H x W; {stack.shape} looks like K colour images: "
            "stack[..., 1] takes one channel of each"
        )
    if stack.ndim == 2:
        raise InputError(
            f"a stack of images is K x H x W, not one image of {stack.shape}: "
            "np.stack([led1, led2, …]) makes one of an image per LED"
        )
    if stack.ndim != 3:
        raise InputError(f"a stack of images is K x H x W, not of shape {stack.shape}")
    if not stack.size:
        raise InputError(f"a stack of images of shape {stack.shape} holds no pixel")
    if stack.dtype.kind not in "uf":
        cure = "; stack.astype(np.uint8) if they are 8 bit" if stack.dtype.kind == "i" else ""
        raise InputError(
            f"a stack of images is of unsigned integers or floats, not {stack.dtype}{cure}"
        )
    if stack.dtype.kind == "f" and not np.isfinite(stack).all():
        raise InputError("the stack of images holds NaN or infinite values")
    return stack
