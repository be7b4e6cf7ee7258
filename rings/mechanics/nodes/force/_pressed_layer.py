"""A layer on cells: the pressure that presses it in, and what a force errs by."""

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.fft import dctn, idctn
from scipy.sparse.linalg import LinearOperator, cg

from tactograph.rings.mechanics.nodes.force.elastic_layer import (
    Compliance,
    layer_compliance,
    wave_numbers,
)
from tactograph.sdk import F4, F8
from tactograph.sdk.unstable import cores

ENOUGH_SHARE = 1e-6
"""Share of the load that is left when conjugate gradients end early."""
MAX_STEPS = 8


class PressedLayer(NamedTuple):
    """A layer's answer to the waves of H x W cells, in mm per kPa."""

    k: F8
    answer: Compliance
    wider: F8
    """The normal answer to the waves of as many cells, each twice as wide."""
    side: int
    """Of a cell in pixels."""
    cell_mm: float

    def pressure(self, height: F4, inside: F4) -> F4:
        """The pressure in kPa on each cell's share of contact, by least squares of slopes."""
        return self._solved(inside * filtered(height, self._to_load()), inside)

    def sensitivity(self, inside: F4, part: F4) -> F4:
        """The derivative by the height of all pressure on a part of the contact."""
        return filtered(inside * self._solved(part, inside), self._to_load())

    def strayed(self, height: F4, pressure: F4) -> tuple[F4, F4]:
        """By how much the linear layer's height may be another than the one seen, in mm.

        A pressure also moves film aside, and a height is seen where the film has moved to: to
        first order that is the way aside times the slope.  The cosine transform mirrors every press
        at the frame's border; in a frame twice as wide its mirror images are farther away.
        """
        potential = filtered(pressure, self.answer.coupled / np.maximum(self.k, self.k[0, 1]))
        slopes = zip(np.gradient(potential), np.gradient(height), strict=True)
        aside = sum(way * slope for way, slope in slopes) / self.cell_mm**2
        size = (rows, columns) = pressure.shape
        half = -(-columns // 2), -(-rows // 2)
        top, left = (rows - half[1]) // 2, (columns - half[0]) // 2
        within, lone = np.s_[top : top + half[1], left : left + half[0]], np.zeros(size, np.float32)
        lone[within] = cv2.resize(pressure, half, interpolation=cv2.INTER_AREA)
        alone = cv2.resize(filtered(lone, self.wider)[within], (columns, rows))
        return np.asarray(aside, np.float32), filtered(pressure, self.answer.normal) - alone

    def _weight(self) -> F8:
        return (self.answer.normal * self.k) ** 2

    def _to_load(self) -> F4:
        return np.asarray(self.answer.normal * self.k**2 / self._weight().max(), np.float32)

    def _solved(self, load: F4, inside: F4) -> F4:
        """Conjugate gradients for the plane that the weight turns into `load`."""
        weight = np.asarray(self._weight() / self._weight().max(), np.float32)

        def moved(plane: F4) -> F4:
            return inside * filtered(inside * plane.reshape(load.shape), weight)

        operator = LinearOperator((load.size, load.size), moved, dtype=np.float32)
        plane, _ = cg(operator, load.ravel(), rtol=ENOUGH_SHARE, maxiter=MAX_STEPS)
        return np.asarray(plane.reshape(load.shape), np.float32)


def pressed_layer(
    shape: tuple[int, ...],
    pixel: float,
    side: int,
    modulus: float,
    thickness: float,
    poisson: float,
) -> PressedLayer:
    """Return the layer under a frame of H x W pixels, on cells of `side` pixels."""
    rows, columns = (-(-size // side) for size in shape)
    k = wave_numbers((rows, columns), side * pixel)
    answers = (layer_compliance(each, thickness, poisson) for each in (k, k / 2))
    answer, wider = (Compliance(*(each / modulus for each in answer)) for answer in answers)
    return PressedLayer(k, answer, wider.normal, side, side * pixel)


def in_cells(plane: NDArray[Any], side: int) -> F4:
    """Means of squares of `side` pixels; those at the border go on beyond it."""
    down, right = (-size % side for size in plane.shape)
    whole = np.pad(plane.astype(np.float32), ((0, down), (0, right)), mode="edge")
    size = whole.shape[1] // side, whole.shape[0] // side
    return np.asarray(cv2.resize(whole, size, interpolation=cv2.INTER_AREA))


def filtered(plane: F4, gain: NDArray[Any]) -> F4:
    """A plane whose waves are multiplied by `gain`."""
    spectrum = dctn(plane, norm="ortho", workers=cores())
    return np.asarray(idctn(gain * spectrum, norm="ortho", workers=cores()), np.float32)


def force_deviation(sensitivity: F4, k: F8) -> float:
    """The standard deviation of a sum over the height, its errors those of integrated slopes.

    `sensitivity` is the sum's derivative by the height, times the height's deviation.
    """
    variance = np.divide(1, k * k, out=np.zeros_like(k), where=k > 0)
    spectrum = dctn(sensitivity, norm="ortho", workers=cores())
    return float(np.sqrt(np.sum(spectrum**2 * variance) / np.mean(variance)))
