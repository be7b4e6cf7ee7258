"""Rays in the image, from pixels towards an LED; ``kernels/headers/rays.clh`` holds the same."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4

MIN_PLAN_PX = np.float32(1e-6)


class Rays(NamedTuple):
    """Rays from pixels: their places, directions, and distances to the LED in px.

    The distance is negative for an LED behind the ray (`lights_in_view`).
    """

    column: F4
    row: F4
    ux: F4
    uy: F4
    plan: F4

    def at(self, t: F4 | np.float32) -> tuple[F4, F4]:
        """The points t px along the rays."""
        return self.column + self.ux * t, self.row + self.uy * t

    def only(self, keep: NDArray[np.bool_] | NDArray[np.intp]) -> Rays:
        return Rays(*(part[keep] for part in self))


def rays_towards(led: F4, column: F4, row: F4, shape: tuple[int, ...]) -> Rays:
    """Return the rays from pixels of an image of this shape towards an LED.

    Its place `led` is in px from the middle of the image.
    """
    rows, columns = shape
    dx = led[0] + np.float32((columns - 1) / 2) - column
    dy = led[1] + np.float32((rows - 1) / 2) - row
    plan = np.copysign(np.maximum(np.sqrt(dx * dx + dy * dy), MIN_PLAN_PX), led[2])
    return Rays(column, row, dx / plan, dy / plan, plan)
