"""The functions of OpenCV that `opencv` calls; OpenCV itself checks their arguments.

All map a float image to a float image of the same size.  To add a function, add its name.
"""

from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np

from tactograph.sdk import F4, InputError

WITH_DEPTH = frozenset({"filter2D", "sepFilter2D", "Sobel", "Scharr", "Laplacian"})
"""Functions with an argument for the depth of their output."""
WITH_BORDER = WITH_DEPTH | {"blur", "GaussianBlur", "bilateralFilter"}
"""Functions that look beyond the frame, where the border goes on unless a call says otherwise."""
FUNCTION_NAMES = sorted(WITH_BORDER | {"medianBlur", "erode", "dilate"})
MAX_WHOLE_NUMBER = 101
"""Largest whole number in a call: no window of a frame is wider."""
TRIAL_IMAGE = np.zeros((8, 8), np.float32)

Arguments = dict[str, bool | int | float | str | list[Any]]


def checked_call(call: dict[str, Arguments]) -> dict[str, Arguments]:
    """Return a call as it is, once OpenCV has accepted it for a small image.

    Raises
    ------
    ValueError
        If the function is not listed, or OpenCV refuses the arguments.
    """
    try:
        call_opencv(TRIAL_IMAGE, call)
    except InputError as error:
        raise ValueError(str(error)) from None
    return call


def call_opencv(plane: F4, call: Mapping[str, Mapping[str, Any]]) -> F4:
    """Call the function for one image, H x W.

    Raises
    ------
    InputError
        See `checked_call`.
    """
    if len(call) != 1:
        raise InputError(f"name one function of OpenCV, not {', '.join(call) or 'none'}")
    ((name, arguments),) = call.items()
    if name not in FUNCTION_NAMES:
        message = f"'{name}' is not on the list of OpenCV's functions"
        raise InputError.unknown(message, name, FUNCTION_NAMES)
    keywords = {"borderType": cv2.BORDER_REPLICATE} if name in WITH_BORDER else {}
    try:
        keywords |= {argument: _as_opencv(argument, arguments[argument]) for argument in arguments}
        if name in WITH_DEPTH:
            keywords["ddepth"] = cv2.CV_32F
        return np.asarray(getattr(cv2, name)(plane, **keywords), np.float32)
    except cv2.error as error:
        reason = error.err.splitlines()[-1].lstrip("> -")
        raise InputError(f"'{name}' of OpenCV refuses these arguments: {reason}") from None
    except (TypeError, ValueError) as error:
        raise InputError(f"'{name}': {error}") from None


def _as_opencv(argument: str, value: Any) -> Any:
    """A value as OpenCV takes it: constants by name, kernels as arrays, sizes as pairs."""
    if isinstance(value, str):
        if not value.startswith("BORDER_") or not hasattr(cv2, value):
            raise ValueError(f"{argument}: '{value}' is no border of OpenCV's")
        return getattr(cv2, value)
    if not np.isfinite(values := np.asarray(value, np.float32)).all():
        raise ValueError(f"{argument}: a finite number is needed")
    if argument.startswith("kernel"):
        return values
    if np.asarray(value).dtype.kind == "i" and np.abs(values).max() > MAX_WHOLE_NUMBER:
        raise ValueError(f"{argument}: {MAX_WHOLE_NUMBER} is the largest whole number")
    return tuple(value) if isinstance(value, list) else value
