"""Arrays that a caller hands in for source nodes."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.graph.backends.arrays import DeviceArray
from tactograph.graph.backends.device_backend import DeviceBackend
from tactograph.graph.declare.ports import PortType
from tactograph.graph.errors import InputError, collect_warnings, message_of
from tactograph.graph.plan.draft import Value
from tactograph.graph.plan.plan import Plan
from tactograph.graph.run.integer_images import as_fractions
from tactograph.graph.run.ownership import own

MAX_LIGHTS = 32
"""A longer first axis is taken for the rows of one image."""


class CallerArray(NamedTuple):
    """An array that a caller hands in; `there` is the array on the device that it is a view of."""

    array: NDArray[Any]
    there: DeviceArray | None = None


class HandedIn(NamedTuple):
    """The arrays of an item by source node, and the warnings of their checks."""

    arrays: dict[str, CallerArray]
    warnings: list[str]


class StandIns:
    """The source nodes that a caller stands in for."""

    def __init__(self, plan: Plan, device: DeviceBackend | None) -> None:
        self._plan, self._device = plan, device
        self._waiting = {task.id for task in plan.tasks.values() if task.stand_in}

    @property
    def names(self) -> list[str]:
        """The names of the nodes that wait for an array."""
        return sorted(map(self._plan.graph.in_short, self._waiting))

    def check(self, arrays: Mapping[str, Any]) -> HandedIn:
        """The caller's arrays, as views where possible.

        Raises InputError if one is missing, unknown, or does not fit the first output of its
        source.
        """
        graph, names = self._plan.graph, sorted(arrays)
        arrays = {graph.in_full(name): array for name, array in arrays.items()}
        if self._waiting != arrays.keys():
            raise InputError(f"{graph.name}: needs arrays for {self.names}, but got {names}")
        warnings: list[str] = []
        with collect_warnings(warnings):
            checked = {name: self._checked(name, array) for name, array in arrays.items()}
        return HandedIn(checked, warnings)

    def owned(self, item: Any) -> HandedIn:
        """A copy of an item of a caller's stream: a mapping, or an array for the only source."""
        arrays = item if isinstance(item, Mapping) else dict.fromkeys(self._waiting, item)
        handed_in = self.check(arrays)
        copies = {name: CallerArray(own(each.array)) for name, each in handed_in.arrays.items()}
        return handed_in._replace(arrays=copies)

    def _checked(self, name: str, array: Any) -> CallerArray:
        """An array: images of 8 or 16 bits stay as they are, all else is converted.

        An array on the device that needs no conversion is also read there.
        """
        node = self._plan.tasks[name].node
        port = next(iter(node.outputs.values()))
        name = self._plan.graph.in_short(name)
        on_device, adopt = array, None
        if hasattr(array, "map_to_host"):
            if self._device is None:
                raise InputError(
                    f"{name} lies on a device that this pipeline does not use; pass {name}.get()"
                )
            array, adopt = self._device.mapped(on_device, name), self._device.adopted
        unconverted = _images(array) if _takes_images(port) else _values(array, name, port)
        if node.check_handed_in is not None:
            node.check_handed_in(unconverted, name)
        array = _converted(unconverted, port).view()
        stays = adopt is not None and array.dtype == unconverted.dtype
        return CallerArray(array, adopt(on_device) if adopt is not None and stays else None)

    def split(
        self, arrays: Mapping[str, CallerArray]
    ) -> tuple[dict[str, NDArray[Any]], dict[Value, DeviceArray]]:
        """Arrays of the host by node, and those on the device by the values they stand for."""
        on_device = {
            Value(name, next(iter(self._plan.tasks[name].node.outputs))): each.there
            for name, each in arrays.items()
            if each.there is not None
        }
        return {name: each.array for name, each in arrays.items()}, on_device

    def item(self, arrays: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
        """The item that the nodes would have yielded."""
        results: dict[str, Any] = {}
        for name, array in arrays.items():
            record = self._plan.tasks[name].node.output_record
            results[name] = array if record is None else record(array)
        return results


def _takes_images(port: PortType) -> bool:
    return port.dims == ("K", "H", "W") and port.unit == "1"


def _converted(array: NDArray[Any], port: PortType) -> NDArray[Any]:
    if array.dtype in (np.uint8, np.uint16) and _takes_images(port):
        return array
    counts = array.dtype.kind == "u" and _takes_images(port)
    return as_fractions(array) if counts else np.asarray(array, port.dtype)


def _values(array: Any, name: str, port: PortType) -> NDArray[Any]:
    """The array, if it has the dimensions and dtype of a port."""
    values = _array(array, name, nan=port.port.nan)
    if port.dtype is None or not port.fits(values.shape):
        raise InputError(
            f"{name} is {port}, not of shape {values.shape}{_one_by_one(values, port)}"
        )
    is_float = port.dtype.kind == "f"
    if not (values.dtype.kind == "f" if is_float else np.can_cast(values.dtype, port.dtype)):
        raise InputError(f"{name} is {port}, not {values.dtype}")
    return values


def _one_by_one(values: NDArray[Any], port: PortType) -> str:
    """Advice for an array with one dimension too many."""
    several = values.ndim == len(port.dims) + 1
    return "; several go through pipeline.stream(arrays), one by one" if several else ""


def _array(array: Any, name: str, *, nan: bool = False) -> NDArray[Any]:
    """The array on the host; refused if it is empty, masked or not finite."""
    if np.ma.is_masked(array):
        raise InputError(f"{name} must not have masked pixels; pass its .data, with all of them")
    try:
        # If an object has both, as a torch tensor does, the error of __array__ is clearer.
        is_dlpack = hasattr(array, "__dlpack__") and not hasattr(array, "__array__")
        values = np.from_dlpack(array) if is_dlpack else np.asarray(array)
    except Exception as error:  # whatever an object's own __array__ raises
        raise InputError(
            f"{name}: a {type(array).__name__} is not an array: {message_of(error)}"
        ) from error
    if not values.size:
        raise InputError(f"{name} of shape {values.shape} holds no pixel")
    if values.dtype.kind == "f" and not nan and not np.isfinite(values).all():
        raise InputError(f"{name} holds NaN or infinite values")
    return values


def _images(array: Any) -> NDArray[Any]:
    """A stack K x H x W of unsigned integers or finite floats."""
    stack = _array(array, "a stack of images")
    shape, but = stack.shape, ""
    if stack.ndim == 3 and shape[2] <= MAX_LIGHTS < shape[0]:
        but = f"; {shape} looks like H x W x K: np.moveaxis(stack, -1, 0) puts the lights first"
    elif stack.ndim == 4 and shape[3] in (3, 4):
        but = f"; {shape} looks like K colour images: stack[..., 1] takes one channel of each"
    elif stack.ndim == 4:
        but = f"; {shape} looks like several: go through pipeline.stream(stacks)"
    elif stack.ndim == 2:
        but = f", not one image of {shape}: np.stack([led1, led2, …]) makes one of an image per LED"
    elif stack.ndim != 3:
        but = f", not of shape {shape}"
    if but:
        raise InputError(f"a stack of images is K x H x W{but}")
    if stack.dtype.kind not in "uf":
        cure = "; stack.astype(np.uint8) if they are 8 bit" if stack.dtype.kind == "i" else ""
        raise InputError(
            f"a stack of images is of unsigned integers or floats, not {stack.dtype}{cure}"
        )
    return stack
