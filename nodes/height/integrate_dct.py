"""Integrate slopes by least squares with free borders, by the cosine transform.

On CPUs the kernels need no VkFFT: they transform 32 columns side by side (``cosine.clh``), then
solve a tridiagonal system along the rows for each frequency.  So all of `reconstruct` stays on the
device.
"""

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import cv2
import numpy as np

from tactograph.graph import Close, node
from tactograph.graph.backends.launch import DeviceArray, Launch
from tactograph.graph.declare.kernel_declaration import DeviceTraits, Obstacle
from tactograph.nodes import F4, Height, PixelSize, Slope
from tactograph.nodes.height._fourier import missing_vkfft, transform

SMALL_PRIME = 64
"""Largest prime factor of the height for which a transform costs less than transposing first."""


@node(tolerance=Close(2e-4, 2e-4, why="two float32 transforms of different libraries"))
def integrate_dct(slope: Slope, pixel: PixelSize) -> Height:
    """Return the height whose differences come closest to the slopes.

    Least squares on the staggered grid (equation D1): the slope between two neighbours is the mean
    of their slopes, and nothing is assumed beyond the border (Neumann).  The DCT-II diagonalises
    this discrete Poisson equation (T. Simchony, R. Chellappa and M. Shao, "Direct analytical
    methods for solving Poisson equations in computer vision problems", IEEE PAMI 12(5), 1990).

    Parameters
    ----------
    slope : 2 x H x W
    pixel : mm per px

    Returns
    -------
    H x W in mm, with zero mean.
    """
    twice = _twice_divergence(slope)
    forwards, backwards = _cosine_transforms(twice.shape)
    return np.asarray(backwards(forwards(twice) * _to_mm(twice.shape, pixel)), np.float32)


def _cosine_transforms(shape: tuple[int, ...]) -> tuple[Callable[[F4], Any], Callable[[F4], Any]]:
    """The orthonormal DCT-II and its inverse.

    SciPy's are twice as fast, but its import takes 0.2 s of a first start and 20 MiB.
    """
    if not any(size % 2 for size in shape):  # OpenCV 4 has no others
        return cv2.dct, cv2.idct
    from scipy.fft import dctn, idctn

    return partial(dctn, norm="ortho"), partial(idctn, norm="ortho")


def _twice_divergence(slope: F4) -> F4:
    """Twice the divergence of the slopes half-way between neighbours; none across the border.

    Half-way slopes are means of neighbours, so that a pixel's own slope cancels.
    """
    p, q = slope
    twice = np.zeros(p.shape, np.float32)
    for slopes, sums in ((p.T, twice.T), (q, twice)):
        if len(slopes) > 1:
            sums[0] += slopes[0] + slopes[1]
            sums[1:-1] += slopes[2:] - slopes[:-2]
            sums[-1] -= slopes[-2] + slopes[-1]
    return twice


@lru_cache(maxsize=8)
def _to_mm(shape: tuple[int, int], pixel: float) -> F4:
    """The factors that turn the spectrum of twice the divergence into that of the height."""
    return np.asarray(inverse_laplacian(shape) * np.float32(0.5 * pixel), np.float32)


@lru_cache(maxsize=8)
def inverse_laplacian(shape: tuple[int, int]) -> F4:
    """One over the eigenvalues 2 cos(pi u / W) + 2 cos(pi v / H) - 4; 0 for the mean."""
    v = np.arange(shape[0])[:, None]
    u = np.arange(shape[1])[None, :]
    eigenvalues = 2 * np.cos(np.pi * u / shape[1]) + 2 * np.cos(np.pi * v / shape[0]) - 4
    eigenvalues[0, 0] = 1
    inverse = (1 / eigenvalues).astype(np.float32)
    inverse[0, 0] = 0
    inverse.flags.writeable = False
    return inverse


def _can_run(device: DeviceTraits) -> Obstacle | None:
    """Devices with lanes do not need VkFFT."""
    missing = None if device.lanes > 1 else missing_vkfft()
    return Obstacle(missing) if missing else None


@integrate_dct.opencl(can_run=_can_run)
def _launch(run: Launch) -> None:
    """Take the divergence, transform it, divide by the eigenvalues, and transform back."""
    if run.lanes > 1:
        _launch_in_lanes(run)
        return
    height, width = shape = run.sizes["H"], run.sizes["W"]
    out = run.outputs["integrate_dct"]
    inverse = run.keep(("inverse", shape), lambda: run.put(inverse_laplacian(shape)))
    cosine = transform(run, shape, np.float32, 2)
    run.kernel("divergence", shape, run.inputs["slope"], out, height, width)
    cosine.forward(run, out)
    run.kernel("divide", shape, out, inverse, height, width, float(run.inputs["pixel"]))
    cosine.inverse(run, out)


def _launch_in_lanes(run: Launch) -> None:
    """Transpose the image first if a large prime divides its height, but not its width."""
    height, width = run.sizes["H"], run.sizes["W"]
    slope, out = run.inputs["slope"], run.outputs["integrate_dct"]
    if _largest_prime(height) <= max(SMALL_PRIME, _largest_prime(width)):
        _integrate(run, slope, out)
        return
    slope_turned, turned = run.scratch((2, width, height)), run.scratch((width, height))
    run.kernel("turn_over", slope.shape, slope, slope_turned, 2, height, width)
    _integrate(run, slope_turned, turned)
    run.kernel("turn_over", (1, width, height), turned, out, 1, width, height)


def _integrate(run: Launch, slope: DeviceArray, out: DeviceArray) -> None:
    """Transform only the columns, and solve a tridiagonal system along the rows per frequency.

    This halves the number of transforms, at the cost of a sweep to the right and one to the left.
    """
    height, width = shape = out.shape[0], out.shape[1]
    turns = run.keep(("turns", height), lambda: run.put(_turns(height)))
    pivots = run.keep(("pivots", shape), lambda: run.put(_pivots(shape)))
    pairs = -(-width // (2 * run.lanes))
    scratch = run.scratch((pairs, 2, height, 2, run.lanes))
    spectrum = run.scratch((width, height))
    # The kernels leave a factor of four: two from the divergence and two from the transform.
    to_mm = 0.25 * float(run.inputs["pixel"])
    grid = run.in_lanes(height)
    run.kernel("transform", (pairs,), slope, turns, scratch, spectrum, height, width, local=(1,))
    run.kernel("solve", grid, spectrum, pivots, height, width, to_mm, local=(1,))
    run.kernel("transform_back", (pairs,), spectrum, turns, scratch, out, height, width, local=(1,))


@lru_cache(maxsize=8)
def _largest_prime(number: int) -> int:
    """The largest prime factor, with which the time of a transform grows."""
    factor, rest = 2, number
    while factor * factor <= rest:
        if rest % factor:
            factor += 1
        else:
            rest //= factor
    return rest


def _turns(count: int) -> F4:
    """Real and imaginary part of exp(-i pi t / 2 count) for t < 4 count."""
    turn = np.exp(-0.5j * np.pi / count * np.arange(4 * count)).astype(np.complex64)
    return turn.view(np.float32).reshape(-1, 2)


def _pivots(shape: tuple[int, int]) -> F4:
    """One over the pivots of the tridiagonal systems along the rows, W x H.

    There is one system for each frequency v down the columns, with 4 - 2 cos(pi v / H) on its
    diagonal, one less at both ends.  The last pivot of v = 0 is zero, because the mean is free;
    0 takes the place of its inverse.
    """
    rows, columns = shape
    diagonal = 4 - 2 * np.cos(np.pi * np.arange(rows) / rows)
    pivots = np.empty((columns, rows))
    before = np.zeros(rows)
    for column in range(columns):
        ends = (column == 0) + (column == columns - 1)
        pivot = diagonal - ends - before
        before = np.divide(1, pivot, out=np.zeros(rows), where=pivot > 1e-9)
        pivots[column] = before
    return pivots.astype(np.float32)
