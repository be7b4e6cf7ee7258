"""The equations for the height as a record, and the residuals of a height."""

import math
from typing import Annotated, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from tactograph.graph.declare.ports import Port
from tactograph.nodes import F4, I4, U1, Height
from tactograph.nodes.height.springs import Springs, Ties

REST_STIFFNESS = np.float32(1e5)
"""Stiffness of the film at rest, in units of the surest step's stiffness."""
SHARED_RISE_PX = 0.5 / math.sqrt(12)
"""Standard deviation of an error that all rises share, in px: shadows are followed in steps of half
a pixel."""
STATE_FREE, STATE_REST, STATE_AWAY = 0, 1, 2
"""The states of a pixel: its height is unknown, it is at rest, or it does not count."""

Pixel = TypeVar("Pixel", bound=np.generic)


class Window(NamedTuple):
    """The part of the frame that is not at rest, with a margin."""

    rows: slice
    columns: slice

    def of(self, plane: NDArray[Pixel]) -> NDArray[Pixel]:
        return np.ascontiguousarray(plane[..., self.rows, self.columns])


class HeightSystem(NamedTuple):
    """Weighted equations inside a window of the frame: steps, rises by shadows, film at rest.

    The height minimises the sum of rho(r^2 / variance), with r the residual of an equation, z = 0
    on the film at rest, and rho as given by `scales`; of rises that it would mostly reject, the sum
    of r^2 / variance.  All rises together are lifted until half of them lie below the height
    (`disagreement`).
    """

    right: Annotated[F4, Port("h w", "mm")]
    """Step of the height to the next pixel; 0 in the last column."""
    down: Annotated[F4, Port("h w", "mm")]
    """Step to the pixel below; 0 in the last row."""
    right_variance: Annotated[F4, Port("h w", "mm^2")]
    """Infinite where a step is unknown, as beyond the window."""
    down_variance: Annotated[F4, Port("h w", "mm^2")]
    state: Annotated[U1, Port("h w", "state", high=2)]
    """0 where the height is unknown, 1 on the film at rest, 2 where a pixel does not count."""
    top: Annotated[I4, Port("T", "pixel number")]
    """The pixels that lie `rise` above `foot`; the window's pixels are counted row by row."""
    foot: Annotated[I4, Port("T", "pixel number")]
    rise: Annotated[F4, Port("T", "mm")]
    corner: Annotated[I4, Port("2", "px")]
    """The window's first row and column."""
    anchored: Annotated[U1, Port("1", "flag", high=1)]
    """1 if any film is at rest; otherwise the median of the frame's border is set to zero."""
    scales: Annotated[NDArray[np.float64], Port("4")]
    """(step, rise, robust, pixel).

    - step, rise: standard deviations of the surest step and of each rise, in mm.
    - robust: Cauchy's c in rho(s) = c^2 log(1 + s / c^2), in standard deviations.
    - pixel: mm per px."""

    @property
    def window(self) -> Window:
        return window_at(self.corner, self.state.shape)

    @property
    def steps(self) -> tuple[F4, F4]:
        """The steps to the right, h x w-1, and down, h-1 x w."""
        return self.right[:, :-1], self.down[:-1]

    def cut(self, height: Height) -> F4:
        """The part of a height inside the window, set to zero on the film at rest."""
        return np.where(self.state == STATE_REST, np.float32(0), self.window.of(height))

    def residuals(self, height: F4) -> tuple[F4, F4, F4]:
        """The residuals of the equations, in mm: steps to the right, steps down, rises."""
        right, down = self.steps
        across, along = height[:, 1:] - height[:, :-1], height[1:] - height[:-1]
        return across - right, along - down, self.rise_residuals(height)

    def rise_residuals(self, height: F4) -> F4:
        """The residuals of the T rises, in mm."""
        flat = height.ravel()
        return flat[self.top] - flat[self.foot] - self.rise

    def cost(self, height: F4, scale: float) -> float:
        """The cost for c = `scale`: the sum of log(1 + r^2 / (scale^2 variance))."""
        square = np.float32(scale * scale)

        def part(residual: F4, variance: F4 | np.float32) -> float:
            return float(np.log1p(residual * residual / square / variance).sum(dtype=float))

        right, down, rise = self.residuals(height)
        steps = part(right, self.right_variance[:, :-1]) + part(down, self.down_variance[:-1])
        return steps + part(rise, rise_variance(self.scales))

    def springs(self, height: F4, scale: float) -> Springs:
        """The network of springs, with the stiffness of Cauchy's weights.

        They are 1 / (variance (1 + r^2 / (scale^2 variance))), in units of the surest step's.
        Where they reject more than half of the rises (r^2 > scale^2 variance), a robust fit has
        broken down, and all rises pull in full.
        """
        unit, square = surest(self.scales), np.float32(scale * scale)

        def stiffness(residual: F4, variance: F4 | np.float32) -> F4:
            return np.asarray(unit / (variance + residual * residual / square), np.float32)

        right, down, rise = self.residuals(height)
        top, foot = self.top.astype(np.int64), self.foot.astype(np.int64)
        within = np.count_nonzero(rise * rise / square <= rise_variance(self.scales))
        rise *= 2 * within >= rise.size
        return Springs(
            stiffness(right, self.right_variance[:, :-1]),
            stiffness(down, self.down_variance[:-1]),
            (self.state == STATE_REST) * REST_STIFFNESS,
            Ties(top, foot, stiffness(rise, rise_variance(self.scales))),
        )

    def disagreement(self, height: F4, scale: float) -> np.float32:
        """By how much a height exceeds half of the rises, beyond an error that all share.

        With Cauchy's weight, since springs that have lost their stiffness take it up later.
        """
        if not self.rise.size:
            return np.float32(0)
        middle = (self.rise.size - 1) // 2
        median = np.partition(self.rise_residuals(height), middle)[middle]
        shared = np.float32(SHARED_RISE_PX * self.scales[3])
        off = median - shared * shared / median if abs(median) > shared else np.float32(0)
        square = np.float32(scale * scale) * rise_variance(self.scales)
        return np.float32(off / (1 + off * off / square))


def window_at(corner: I4, shape: tuple[int, ...]) -> Window:
    """The window of this shape whose first row and column are `corner`."""
    (row, column), (rows, columns) = corner.tolist(), shape
    return Window(slice(row, row + rows), slice(column, column + columns))


def surest(scales: NDArray[np.float64]) -> np.float32:
    """The variance of the surest step, in mm^2."""
    return np.float32(float(scales[0]) ** 2)


def rise_variance(scales: NDArray[np.float64]) -> np.float32:
    """The variance of a shadow's rise, in mm^2."""
    return np.float32(float(scales[1]) ** 2)
