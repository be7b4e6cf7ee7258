"""Transforms on the device by VkFFT, shared by the integrators."""

import importlib.util

from tactograph.graph.backends.launch import DeviceArray, Launch


def missing_vkfft() -> str | None:
    """A message with the remedy if VkFFT is not installed, else None."""
    if importlib.util.find_spec("pyvkfft") is not None:
        return None
    return "pyvkfft is not installed (pip install 'tactograph[vkfft]')"


class _Vkfft:
    """A planned transform of one shape, in place."""

    def __init__(self, run: Launch, shape: tuple[int, int], dtype: type, dct: int | bool) -> None:
        from pyvkfft.opencl import VkFFTApp

        self._app = VkFFTApp(shape, dtype, queue=run.queue, ndim=2, dct=dct, norm=1, inplace=True)

    def forward(self, run: Launch, field: DeviceArray) -> None:
        run.library(self._app.fft, field, last=False)

    def inverse(self, run: Launch, field: DeviceArray) -> None:
        run.library(self._app.ifft, field, last=True)


class _OnePixel:
    """The transform of one pixel, which is its own spectrum; VkFFT refuses that size."""

    def forward(self, run: Launch, field: DeviceArray) -> None: ...

    def inverse(self, run: Launch, field: DeviceArray) -> None: ...


Transform = _Vkfft | _OnePixel


def transform(run: Launch, shape: tuple[int, int], dtype: type, dct: int | bool) -> Transform:
    """A two-dimensional transform: the DCT of this type, or the complex FFT if that is False.

    The inverse restores the scale, too.
    """
    if shape == (1, 1):
        return _OnePixel()
    return run.keep((dct, shape), lambda: _Vkfft(run, shape, dtype, dct))
