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
from tactograph.sdk import F4, F8, cores
from tactograph.sdk.nodes import integrate_dct

ENOUGH_SHARE = 1e-6
"""Share of the load that is left when conjugate gradients end early."""
MAX_STEPS = 8
EDGE_CELLS = 2.0
"""Over which pressures are smoothed to find where they end; they reach three times as far."""


class Pressed(NamedTuple):
    """What presses on H x W cells."""

    pressure: F4
    """kPa."""
    inside: F4
    """Share of each cell that is pressed."""
    apart: F4
    """mm, by how much the layer's height is above that seen, also of film that hangs."""


class PressedLayer(NamedTuple):
    """A layer's answer to the waves of H x W cells, in mm per kPa."""

    k: F8
    answer: Compliance
    side: int
    """Of a cell in pixels."""
    cell_mm: float

    def pressed(self, height: F4, inside: F4) -> Pressed:
        """The pressure by least squares of slopes, inside the contacts as far as they push.

        Film that hangs beside an object is raised and pulls at nothing.  So pressures below zero
        are errors, which push as often as they pull: what is within their size is no contact.

        A pressure also moves film aside, and a height is seen where the film has moved to: to
        first order that is the way aside times the slope.
        """
        first = self._pressure(height, inside)
        pulls, smooth = first[first < 0], cv2.GaussianBlur(first, (0, 0), EDGE_CELLS)
        least = float(np.sqrt(np.mean(pulls**2))) if pulls.size else 0.0
        pushed = np.where(smooth > min(least, float(smooth.max()) / 2), inside, np.float32(0))
        answer = self.answer.coupled / np.maximum(self.k, self.k[0, 1])
        ways, slopes = np.gradient(filtered(first * pushed, answer)), np.gradient(height)
        moved = sum(way * slope for way, slope in zip(ways, slopes, strict=True))
        height = height + moved / self.cell_mm**2
        pressure = self._pressure(height, pushed)
        apart = filtered(pressure * pushed, self.answer.normal) - height
        return Pressed(pressure, pushed, apart)

    def sensitivity(self, inside: F4, part: F4) -> F4:
        """The derivative by the height of all pressure on a part of the contact."""
        return filtered(inside * self._solved(part, inside), self._to_load())

    def misfit(self, cells: Pressed) -> F4:
        """Return by how much a height is too low if the layer is right about film that hangs, mm.

        A sensor holds film at zero that it takes for film at rest, and takes the light of its
        slopes, which change over the frame, for LEDs that have drifted, also where film is pushed.
        """
        away = cv2.distanceTransform((cells.inside == 0).view(np.uint8), cv2.DIST_L2, 3)
        beside = away > 3 * EDGE_CELLS
        slopes = np.stack([np.gradient(cells.apart, self.cell_mm, axis=axis) for axis in (1, 0)])
        y, x = np.indices(cells.apart.shape, np.float32)
        terms = np.stack([np.ones_like(x), x, y], axis=-1)
        drift, *_ = np.linalg.lstsq(terms[beside], slopes[:, beside].T, rcond=None)
        both = np.where(beside, slopes, np.moveaxis(terms @ drift, -1, 0))
        return integrate_dct(both.astype(np.float32), self.cell_mm)

    def _pressure(self, height: F4, inside: F4) -> F4:
        return self._solved(inside * filtered(height, self._to_load()), inside)

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
    answer = Compliance(*(each / modulus for each in layer_compliance(k, thickness, poisson)))
    return PressedLayer(k, answer, side, side * pixel)


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
