"""How the slopes of a scan become levelled heights: weights, drift of the slopes, plane.

A light model of few monomials takes level film for tilted, by an amount that drifts over the
frame, and steep film is measured worst.  Integrated as they are, such slopes bend the film: a grid
of balls on flat film by 25 um, a coin by 150 um.
"""

import numpy as np
from numpy.typing import NDArray

from tactograph.rings.metrology.nodes.filled.level_plane import (
    level_part,
    plane_terms,
    plane_weights,
    weighted_plane,
)
from tactograph.rings.metrology.nodes.scan._weighted_heights import weighted_heights
from tactograph.rings.metrology.nodes.scan.light_model import (
    PIXEL_UNKNOWNS,
    LightModel,
    slope_by_light,
)
from tactograph.rings.metrology.nodes.scan.light_model_slope import ModelSlope
from tactograph.sdk import F4, F8, warn

MAX_DRIFT = 0.15
"""Most that the slope of flat film drifts from side to side by a model; a surface that bends more
is no flat one.  0.09 on a coin, 0.05 on grids of balls."""
MIN_EXTENT_SHARE = 0.5
"""Share of the frame's width and height over which film must be known as level to tell a drift."""
MIN_SLOPE_DEVIATION = 0.02
"""Smallest standard deviation of a slope by a light model."""
MIN_DEVIATION = 1e-3
"""Smallest deviation of a slope from the others' drift, above which it counts less."""


class ScanLevelling:
    """Turns slopes of cells into heights as it does those of the scan that it was made for.

    Parameters
    ----------
    solved : of cells
    model : on cells
    pixel : side of a cell in mm
    level : as for `level_scan`
    cell : side of a cell in px
    """

    def __init__(
        self, solved: ModelSlope, model: LightModel, pixel: float, level: str, cell: int
    ) -> None:
        slope, brightness, residual, _ = solved
        self.shape, self.pixel = slope.shape[1:], pixel
        self.place = (*np.meshgrid(model.u, model.v),)
        self.by_light = slope_by_light(slope, brightness, model, self.place)
        leds = self.by_light.shape[1]
        light = np.square(residual) * leds / (leds - PIXEL_UNKNOWNS)
        variance = np.square(self.by_light).sum(axis=1) * light + MIN_SLOPE_DEVIATION**2
        self._integrate = weighted_heights(variance.astype(np.float32), pixel)
        self.terms = np.stack([np.broadcast_to(t, self.shape) for t in plane_terms(*self.shape)])
        self._marked = level_part("plane" if level == "flat" else level, self.shape, cell)
        self._drifting: F8 | None = None if level == "plane" else self._drift_weights(slope)
        self.drift = self._drift(slope)
        if np.abs(self.drift[:, 1:]).max() > MAX_DRIFT:
            warn(
                f"the surface bends by a slope of {np.abs(self.drift[:, 1:]).max():.2g} over the "
                f"frame, too much for flat film: `level`={level} takes nothing but a plane off it"
            )
            self._drifting, self.drift = None, np.zeros((2, 3))
        rows = self.terms.reshape(3, -1).T
        bent = self._integrate(self._flat(slope)).ravel()
        weights = plane_weights(rows, bent) if self._marked is None else self._marked.ravel() * 1.0
        self._plane = np.linalg.pinv(rows * np.sqrt(weights)[:, None]) * np.sqrt(weights)

    def heights(self, slope: F4) -> F8:
        """The levelled height, H x W in mm, of slopes 2 x H x W that count as the scan's did."""
        return self.levelled(self._integrate(self._flat(slope)))

    def levelled(self, height: F4 | F8) -> F8:
        """A height less the plane of what is level, H x W in mm."""
        return np.asarray(height - np.tensordot(self._plane @ height.ravel(), self.terms, 1))

    def _flat(self, slope: F4) -> F4:
        """The slopes without their drift."""
        return np.asarray(slope - np.tensordot(self._drift(slope), self.terms, 1), np.float32)

    def _drift(self, slope: F4) -> F8:
        """What the slopes of level film are, 2 x (middle, change from left to right, down)."""
        if self._drifting is None:
            return np.zeros((2, 3))
        rows, slopes = self.terms.reshape(3, -1).T, slope.reshape(2, -1).T.astype(float)
        return weighted_plane(rows, slopes, self._drifting.ravel()).T

    def _drift_weights(self, slope: F4) -> F8 | None:
        """Weights of level film, whose slopes agree on a drift; None if it shows too little."""
        is_usable = np.ones(self.shape, bool) if self._marked is None else self._marked
        if not _is_wide(is_usable):
            return None
        weights = np.zeros(self.shape)
        slopes = slope[:, is_usable].T.astype(float)
        weights[is_usable] = plane_weights(self.terms[:, is_usable].T, slopes, MIN_DEVIATION)
        return weights


def _is_wide(marked: NDArray[np.bool_]) -> bool:
    """Whether the marked part reaches over enough of the frame to tell how slopes drift."""
    spans = (np.ptp(where) + 1 if where.size else 0 for where in np.nonzero(marked))
    return all(
        span > MIN_EXTENT_SHARE * side for span, side in zip(spans, marked.shape, strict=True)
    )
