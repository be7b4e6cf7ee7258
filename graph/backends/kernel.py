"""One kernel: its arguments checked and converted by its signature, and launched."""

from __future__ import annotations

import faulthandler
import os
from collections.abc import Callable, Sequence
from functools import partial
from types import FunctionType
from typing import Any, TypeVar

import numpy as np
import pyopencl as cl

from tactograph.graph.backends.arrays import DeviceArray
from tactograph.graph.backends.kernel_source import C_DTYPES, Argument

T = TypeVar("T")
WAIT_VARIABLE = "TACTOGRAPH_WAIT"
"""If this environment variable is 1, each launch is waited for, and named if it crashes."""


class Kernel:
    """A kernel whose argument types are fixed at its first launch.

    With declared argument types, pyopencl sets all arguments in the time that one takes without.
    `signature` are the arguments as the source declares them.
    """

    def __init__(self, kernel: cl.Kernel, signature: Sequence[Argument] = ()) -> None:
        self._kernel = kernel
        self.name = kernel.function_name
        self._copies: list[Kernel] = []
        self._signature = signature
        self._converters = [converter(c_type) for c_type, _ in signature]
        self._typed = False

    def converted(self, arguments: Sequence[Any]) -> list[Any]:
        """Convert the arguments to numbers of the kernel's types and buffers.

        Raises
        ------
        TypeError
            If there are too many or too few arguments, or one has a wrong type.
        """
        signature = self._signature
        if len(arguments) != len(signature):
            takes = ", ".join(name for _, name in signature)
            raise TypeError(
                f"kernel {self.name} takes {len(signature)} arguments ({takes}), "
                f"not {len(arguments)}"
            )
        converted: list[Any] = []
        try:
            for value, convert in zip(arguments, self._converters, strict=True):
                converted.append(convert(value))
        except (TypeError, ValueError, OverflowError):
            number = len(converted)
            raise TypeError(
                f"kernel {self.name}: argument {number + 1} is '{' '.join(signature[number])}', "
                f"not {in_words(arguments[number])}"
            ) from None
        return converted

    def copy(self) -> Kernel:
        """Copy the kernel, with arguments of its own."""
        kernel = cl.Kernel(self._kernel.program, self.name)
        return Kernel(kernel, self._signature)

    def numbered_copy(self, number: int) -> Kernel:
        """The copy of this number; it is made once, since that takes as long as 100 launches."""
        while len(self._copies) <= number:
            self._copies.append(self.copy())
        return self._copies[number]

    def bind(
        self,
        queue: cl.CommandQueue,
        work_items: tuple[int, ...],
        local: tuple[int, ...],
        arguments: Sequence[Any],
    ) -> Callable[[], cl.Event]:
        """Set the arguments; return a function that launches the kernel with them.

        It launches over `work_items` in work-groups of `local`, both fastest axis first.
        """
        if not self._typed:
            types = [type(a) if isinstance(a, np.generic) else None for a in arguments]
            self._kernel.set_arg_types(types)
            self._typed = True
        self._kernel.set_args(*arguments)
        launch = partial(cl.enqueue_nd_range_kernel, queue, self._kernel, work_items, local)
        return self._named(launch, arguments)

    def _named(
        self, launch: Callable[[], cl.Event], arguments: Sequence[Any]
    ) -> Callable[[], cl.Event]:
        """If `WAIT_VARIABLE` is 1, launch and wait in a function named after kernel and arguments.

        A kernel that goes out of bounds may end the process.  Python's fault handler then prints
        only the names of the running functions.
        """
        if os.environ.get(WAIT_VARIABLE) != "1":
            return launch
        if not faulthandler.is_enabled():
            faulthandler.enable()
        names = [name for _, name in self._signature] or [""] * len(arguments)
        listed = ", ".join(map(_in_short, names, arguments))
        return partial(renamed(_launch_and_wait, f"kernel {self.name}({listed})"), launch)


def renamed(function: Callable[..., T], name: str) -> Callable[..., T]:
    """Return a function under another name, which may be any text."""
    code = function.__code__.replace(co_name=name, co_qualname=name)
    return FunctionType(code, function.__globals__)


def _launch_and_wait(launch: Callable[[], cl.Event]) -> cl.Event:
    event = launch()
    event.wait()
    return event


def _in_short(name: str, value: Any) -> str:
    """An argument in a word: the size of a buffer, or the value of a number."""
    if isinstance(value, cl.MemoryObjectHolder):
        return f"{name}: {value.size} bytes"
    return f"{name}={value}"


# Tuples, as a union would be made at each use.
_BUFFER_KINDS = cl.LocalMemory, cl.MemoryObjectHolder
_WHOLE_KINDS = int, np.integer
_NUMBER_KINDS = float, *_WHOLE_KINDS, np.floating


def converter(c_type: str) -> Callable[[Any], Any]:
    """A function that converts a value to a kernel argument, or raises if it cannot."""
    if c_type.endswith("*"):
        dtypes = C_DTYPES.get(c_type.rstrip("*").rstrip("0123456789"))
        types = None if dtypes is None else frozenset(map(np.dtype, dtypes))
        return partial(_buffer, types)
    if c_type == "float":
        return _float
    if c_type in ("int", "uint", "uchar", "ushort"):
        return partial(_whole, np.dtype(C_DTYPES[c_type][0]).type)
    return lambda value: value


def in_words(value: Any) -> str:
    """Describe a value that a kernel cannot take, for an error."""
    if isinstance(value, DeviceArray):
        return f"an array of {value.dtype}"
    return f"{value!r} ({type(value).__name__})"


def _buffer(dtypes: frozenset[np.dtype[Any]] | None, value: Any) -> Any:
    if isinstance(value, DeviceArray):
        if dtypes is not None and value.dtype not in dtypes:
            raise TypeError
        return value.memory.buffer
    if value is None or isinstance(value, _BUFFER_KINDS):
        return value
    raise TypeError


def _float(value: Any) -> np.float32:
    if isinstance(value, _NUMBER_KINDS):
        return np.float32(value)
    raise TypeError


def _whole(make: Callable[[int], Any], value: Any) -> Any:
    if isinstance(value, _WHOLE_KINDS):
        return make(int(value))  # which refuses a number out of range
    raise TypeError
