"""Integrate slopes by Frankot and Chellappa's projection in the frequency domain."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fftfreq, irfft2, rfft2, rfftfreq

from tactograph.graph import Close, node
from tactograph.graph.backends.launch import Launch
from tactograph.graph.cores import cores
from tactograph.graph.declare.kernel_declaration import DeviceTraits, Obstacle
from tactograph.nodes import F4, Height, PixelSize, Slope
from tactograph.nodes.height._fourier import missing_vkfft, transform

C8 = NDArray[np.complex64]


@node(tolerance=Close(5e-4, 5e-4, why="two float32 transforms of different libraries"))
def integrate_frankot_chellappa(slope: Slope, pixel: PixelSize) -> Height:
    """Project the slopes onto integrable ones (section 3.4, equation 14).

    R. T. Frankot and R. Chellappa, "A method for enforcing integrability in shape from
    shading algorithms", IEEE PAMI 10(4), 1988.  The projection assumes periodic borders: the same
    height at opposite sides.  On a CPU the NumPy function is faster, so the engine prefers it.

    Parameters
    ----------
    slope : 2 x H x W
    pixel : mm per px

    Returns
    -------
    H x W in mm, with zero mean.
    """
    p, q = slope
    times_v, times_u = _multipliers(p.shape)
    spectrum = rfft2(p, workers=cores())
    spectrum *= times_u
    spectrum_q = rfft2(q, workers=cores())
    spectrum_q *= times_v
    spectrum += spectrum_q
    height = irfft2(spectrum, s=p.shape, workers=cores(), overwrite_x=True)
    return np.asarray(height * np.float32(pixel), np.float32)


@lru_cache(maxsize=8)
def _multipliers(shape: tuple[int, ...]) -> tuple[C8, C8]:
    """-i v / (u^2 + v^2) and -i u / (u^2 + v^2), which multiply the spectra of q and of p."""
    v, u = _frequencies(shape)
    square = u * u + v * v
    inverse = np.complex64(-1j) * np.divide(1, square, np.zeros_like(square), where=square > 0)
    return v * inverse, u * inverse


def _frequencies(shape: tuple[int, ...]) -> tuple[F4, F4]:
    """2 pi v / M and 2 pi u / N in radians per pixel, half a spectrum wide."""
    v = 2 * np.pi * fftfreq(shape[0])[:, None]
    u = 2 * np.pi * rfftfreq(shape[1])[None, :]
    # The Nyquist frequency of an even size carries no slope: sin(pi x) is 0 on every pixel.
    if shape[0] % 2 == 0:
        v[shape[0] // 2] = 0
    if shape[1] % 2 == 0:
        u[:, -1] = 0
    return v.astype(np.float32), u.astype(np.float32)


def _can_run(device: DeviceTraits) -> Obstacle | None:
    missing = missing_vkfft()
    slower = "SciPy transforms faster than VkFFT on a CPU" if device.is_cpu else None
    return Obstacle(missing, slower) if missing or slower else None


@integrate_frankot_chellappa.opencl(can_run=_can_run)
def _launch(run: Launch) -> None:
    """Transform both slopes, combine them, transform back."""
    height, width = shape = run.sizes["H"], run.sizes["W"]
    v, u = run.keep(("frequencies", shape), lambda: [*map(run.put, _frequencies(shape))])
    # Both real fields as one complex field p + i q: one transform instead of two.
    packed = run.scratch(shape, np.complex64)
    fourier = transform(run, shape, np.complex64, False)
    run.kernel("pack", shape, run.inputs["slope"], packed, height, width)
    fourier.forward(run, packed)
    spectrum = run.scratch(shape, np.complex64)
    run.kernel("combine", shape, packed, v, u, spectrum, height, width)
    fourier.inverse(run, spectrum)
    out = run.outputs["integrate_frankot_chellappa"]
    run.kernel("real_part", shape, spectrum, out, height, width, float(run.inputs["pixel"]))
