"""Transforms on the device, by VkFFT or in place by SciPy; shared by the integrators."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from scipy.fft import dctn, idctn

from tactograph.graph.backends.launch import DeviceArray, Launch, as_array
from tactograph.nodes import F4

REQUIRES = ("pyvkfft", "pip install 'tactograph[vkfft]'")
ON_CPU = "SciPy transforms 1.5 to 10 times as fast as VkFFT"


class Transform(Protocol):
    """A planned transform of one shape, in place."""

    def forward(self, found: DeviceArray) -> None: ...

    def inverse(self, found: DeviceArray) -> None: ...


class _Vkfft:
    def __init__(self, run: Launch, shape: tuple[int, int], dtype: type, dct: int | bool) -> None:
        from pyvkfft.opencl import VkFFTApp

        # Not the launch itself, which holds the buffers of its item.
        self._queue = run.queue
        self._app = VkFFTApp(shape, dtype, queue=run.queue, ndim=2, dct=dct, norm=1, inplace=True)

    def forward(self, found: DeviceArray) -> None:
        self._app.fft(as_array(self._queue, found))

    def inverse(self, found: DeviceArray) -> None:
        self._app.ifft(as_array(self._queue, found))


class _Scipy:
    """SciPy's cosine transform, of the device's memory where that is the host's own."""

    def __init__(self, run: Launch) -> None:
        self._run = run

    def forward(self, found: DeviceArray) -> None:
        self._in_place(dctn, found)

    def inverse(self, found: DeviceArray) -> None:
        self._in_place(idctn, found)

    def _in_place(self, transform: Callable[..., F4], found: DeviceArray) -> None:
        with self._run.on_host(found) as plane:
            made = transform(plane, type=2, norm="ortho", workers=-1, overwrite_x=True)
            if not np.shares_memory(made, plane):
                plane[...] = made


class _OnePixel:
    """VkFFT refuses to transform nothing; one pixel is its own spectrum."""

    def forward(self, found: DeviceArray) -> None: ...

    def inverse(self, found: DeviceArray) -> None: ...


def cosine_transform(run: Launch, shape: tuple[int, int]) -> Transform:
    """The two-dimensional DCT-II; its inverse undoes it, scale included."""
    if run.shares_memory:
        return _Scipy(run)
    return _planned(run, shape, np.float32, 2)


def fourier_transform(run: Launch, shape: tuple[int, int]) -> Transform:
    """The two-dimensional complex FFT; its inverse undoes it, scale included."""
    return _planned(run, shape, np.complex64, False)


def _planned(run: Launch, shape: tuple[int, int], dtype: type, dct: int | bool) -> Transform:
    if shape == (1, 1):
        return _OnePixel()
    return run.keep((dct, shape), lambda: _Vkfft(run, shape, dtype, dct))
