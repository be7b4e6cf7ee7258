"""The paper's flow as one would write it down with NumPy and SciPy: what all is compared with."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

F8 = NDArray[np.float64]
THRESHOLD = 3.0


class Literal:
    """Trees and coefficients from a calibration file; called with images of 0..1."""

    def __init__(self, file: str) -> None:
        with np.load(file, allow_pickle=False) as found:
            self._cal: dict[str, NDArray[Any]] = dict(found)
        light, slope, lit = (self._cal[f"lut_{part}"] for part in ("light", "slope", "lit"))
        every = (1 << light.shape[1]) - 1
        self._trees = []
        for led in range(-1, light.shape[1]):
            needed = every if led < 0 else every & ~(1 << led)
            chosen = (lit & needed) == needed
            lights = [k for k in range(light.shape[1]) if k != led]
            self._trees.append((cKDTree(light[chosen][:, lights]), slope[chosen], lights))

    def __call__(self, images: NDArray[Any]) -> F8:
        """K x H x W to a height of H x W in mm."""
        light = (images - self._cal["dark"]) / np.maximum(self._cal["flat"], 0.02)
        departure = np.tensordot(self._cal["null"], light, axes=1)
        shadowed = np.abs(departure) > THRESHOLD * self._cal["spread"]
        label = np.where(shadowed, light.argmin(axis=0) + 1, 0)
        slope = np.zeros((2, *label.shape))
        for number, (tree, slopes, lights) in enumerate(self._trees):
            here = label == number
            if here.any():
                _, nearest = tree.query(light[lights][:, here].T, workers=-1)
                slope[:, here] = slopes[nearest].T
        slope[:, label == 0] = _refine(slope[:, label == 0], light[:, label == 0], self._cal)
        return _integrate(slope) * float(self._cal["pixel_size"])


def _refine(slope: F8, light: F8, cal: dict[str, NDArray[Any]]) -> F8:
    """One Taylor step of the spherical-harmonic reflectance (equations 4 to 6)."""
    p, q = slope
    length = np.sqrt(1 + p * p + q * q)
    x, y, z = normal = np.stack([-p, -q, np.ones_like(p)]) / length
    one, zero = np.ones_like(x), np.zeros_like(x)
    basis = np.stack([one, x, y, z, x * y, x * z, y * z, x * x - y * y, 3 * z * z - 1])
    by_normal = np.stack([
        [zero, one, zero, zero, y, z, zero, 2 * x, zero],
        [zero, zero, one, zero, x, zero, z, -2 * y, zero],
        [zero, zero, zero, one, zero, x, y, zero, 6 * z],
    ])  # fmt: skip
    by_p = (np.stack([-one, zero, zero]) - normal * (p / length)) / length
    by_q = (np.stack([zero, -one, zero]) - normal * (q / length)) / length
    gradient = np.einsum("kc,acn->kan", cal["reflectance"], by_normal)
    j_p, j_q = (np.einsum("kan,an->kn", gradient, by) for by in (by_p, by_q))
    rest = light - cal["reflectance"] @ basis
    a, b, c = (j_p * j_p).sum(0), (j_p * j_q).sum(0), (j_q * j_q).sum(0)
    u, v = (j_p * rest).sum(0), (j_q * rest).sum(0)
    determinant = np.maximum(a * c - b * b, 1e-12)
    return slope + np.stack([c * u - b * v, a * v - b * u]) / determinant


def _integrate(slope: F8) -> F8:
    """Frankot and Chellappa, in double precision (equation 14)."""
    rows, columns = slope.shape[1:]
    v = 2 * np.pi * np.fft.fftfreq(rows)[:, None]
    u = 2 * np.pi * np.fft.fftfreq(columns)[None, :]
    squares = u * u + v * v
    squares[0, 0] = 1
    spectrum = -1j * (u * np.fft.fft2(slope[0]) + v * np.fft.fft2(slope[1])) / squares
    spectrum[0, 0] = 0
    height = np.fft.ifft2(spectrum).real
    return height - np.median(np.concatenate([height[0], height[-1], height[:, 0], height[:, -1]]))
