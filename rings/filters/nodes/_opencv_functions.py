"""The functions of OpenCV that `opencv` calls: their arguments, by OpenCV's names.

All map a float image to a float image of the same size; ``src``, ``dst`` and ``ddepth`` are not
arguments here.  To add a function, add an entry.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import cv2
import numpy as np
from annotated_types import Ge, Interval, Le, Len
from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError, create_model

from tactograph.sdk import F4, InputError, did_you_mean


def _odd(value: int) -> int:
    if value % 2 == 0:
        raise ValueError("an odd number is needed")
    return value


def _even_rows(rows: list[list[float]]) -> list[list[float]]:
    if len({len(row) for row in rows}) > 1:
        raise ValueError("rows of the same length are needed")
    return rows


Number = Annotated[float, Ge(-1e6), Le(1e6)]
Sigma = Annotated[float, Interval(gt=0, le=100)]
Side = Annotated[int, Interval(ge=1, le=101)]
OddSide = Annotated[Side, AfterValidator(_odd)]
Order = Annotated[int, Interval(ge=0, le=2)]
Derivative = Literal[1, 3, 5, 7]
Row = Annotated[list[Number], Len(1, 31)]
Matrix = Annotated[list[Row], Len(1, 31), AfterValidator(_even_rows)]
Border = Literal["BORDER_REPLICATE", "BORDER_REFLECT", "BORDER_REFLECT_101", "BORDER_CONSTANT"]

BORDER_ARGUMENTS = {"borderType": (Border, "BORDER_REPLICATE")}
SCALE_ARGUMENTS = {"scale": (Number, 1.0), "delta": (Number, 0.0), **BORDER_ARGUMENTS}
ELEMENT_ARGUMENTS = {
    "kernel": (Matrix, ...),
    "iterations": (Annotated[int, Interval(ge=1, le=31)], 1),
}

FUNCTION_ARGUMENTS: Mapping[str, Mapping[str, Any]] = {
    "blur": {"ksize": (tuple[Side, Side], ...), **BORDER_ARGUMENTS},
    "GaussianBlur": {
        "ksize": (tuple[OddSide, OddSide], ...),
        "sigmaX": (Sigma, ...),
        "sigmaY": (Annotated[float, Interval(ge=0, le=100)], 0.0),
        **BORDER_ARGUMENTS,
    },
    "medianBlur": {"ksize": (Literal[3, 5], ...)},
    "bilateralFilter": {
        "d": (Annotated[int, Interval(ge=1, le=31)], ...),
        "sigmaColor": (Sigma, ...),
        "sigmaSpace": (Sigma, ...),
        **BORDER_ARGUMENTS,
    },
    "filter2D": {"kernel": (Matrix, ...), "delta": (Number, 0.0), **BORDER_ARGUMENTS},
    "sepFilter2D": {
        "kernelX": (Row, ...),
        "kernelY": (Row, ...),
        "delta": (Number, 0.0),
        **BORDER_ARGUMENTS,
    },
    "Sobel": {"dx": (Order, ...), "dy": (Order, ...), "ksize": (Derivative, 3), **SCALE_ARGUMENTS},
    "Scharr": {"dx": (Order, ...), "dy": (Order, ...), **SCALE_ARGUMENTS},
    "Laplacian": {"ksize": (Derivative, 1), **SCALE_ARGUMENTS},
    "erode": ELEMENT_ARGUMENTS,
    "dilate": ELEMENT_ARGUMENTS,
}
WITH_DEPTH = frozenset({"filter2D", "sepFilter2D", "Sobel", "Scharr", "Laplacian"})
"""Functions with an argument for the depth of their output."""
TRIAL_IMAGE = np.zeros((8, 8), np.float32)

Arguments = dict[str, bool | int | float | str | list[Any]]


def checked_call(call: dict[str, Arguments]) -> dict[str, Arguments]:
    """Return a call as it is, once OpenCV has accepted it for a small image.

    Raises
    ------
    ValueError
        If the function is not listed, an argument is unknown, missing or out of its range,
        or OpenCV refuses them together.
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
    if name not in FUNCTION_ARGUMENTS:
        raise InputError(
            f"'{name}' is not on the list of OpenCV's functions"
            + (
                did_you_mean(name, FUNCTION_ARGUMENTS)
                or f"; it has {', '.join(FUNCTION_ARGUMENTS)}"
            )
        )
    keywords = _keywords(name, arguments)
    if name in WITH_DEPTH:
        keywords["ddepth"] = cv2.CV_32F
    try:
        return np.asarray(getattr(cv2, name)(plane, **keywords), np.float32)
    except cv2.error as error:
        raise InputError(f"'{name}' of OpenCV refuses these arguments: {error.err}") from None


def _keywords(name: str, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """A function's arguments as OpenCV takes them, defaults filled in."""
    for argument in arguments:
        if argument not in FUNCTION_ARGUMENTS[name]:
            raise InputError(
                f"'{name}' has no argument '{argument}'; it has "
                + ", ".join(FUNCTION_ARGUMENTS[name])
            )
    try:
        model = ARGUMENT_MODELS[name].model_validate(dict(arguments))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        message = first["msg"].removeprefix("Value error, ")
        raise InputError(f"'{name}': {where}: {message[0].lower()}{message[1:]}") from None
    return {argument: _as_opencv(value) for argument, value in model}


def _as_opencv(value: Any) -> Any:
    if isinstance(value, str):
        return getattr(cv2, value)
    return np.asarray(value, np.float32) if isinstance(value, list) else value


ARGUMENT_MODELS: Mapping[str, type[BaseModel]] = {
    name: create_model(
        name, __config__=ConfigDict(extra="forbid", allow_inf_nan=False), **dict(arguments)
    )
    for name, arguments in FUNCTION_ARGUMENTS.items()
}
