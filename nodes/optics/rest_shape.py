"""The film at rest where it is no plane.

Light stays relative to a plane at height 0 under the same LEDs (N1, F1), which no camera needs to
see: divided by what the model says of the film at rest, the flat frame is that of the plane::

    flat_plane = flat / r,   r_k = F1(n_rest, P_rest) + B(P_rest)                          (F5)

So every formula holds for the film's absolute height, and none knows of its shape.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from tactograph.nodes import F4, F8, Film
from tactograph.nodes.optics.difference import difference
from tactograph.nodes.optics.film import predict
from tactograph.nodes.optics.near_light import places

MIN_VIEW_SHARE = 0.1
"""Smallest denominator: beyond it the camera sees the film from behind."""
MIN_REST_LIGHT = 0.02
"""Least light of the film at rest, over that of a plane, that is divided by: an LED that hardly
reaches a place tells nothing of it."""


@dataclass(frozen=True)
class RestShape:
    """The film at rest: its height in mm where each pixel sees it, H x W.

    `pixel` is in mm per px at height 0, `camera` one over the height of the pupil.
    """

    height: F4
    pixel: float
    camera: float = 0.0

    @cached_property
    def seen(self) -> F4:
        """The height that the camera sees (V1)."""
        return np.asarray(self.height / (1 - np.float32(self.camera) * self.height), np.float32)

    @cached_property
    def tilt(self) -> F4:
        """Slopes of the seen height, 2 x H x W."""
        steps = [difference(self.seen, axis) / np.float32(self.pixel) for axis in (1, 0)]
        return np.stack(steps).astype(np.float32)

    @cached_property
    def slope(self) -> F4:
        """Slopes of the film, 2 x H x W (V2)."""
        p, q = self.tilt
        u, v = self._places()
        rising = self.seen - p * u - q * v
        steep = np.maximum(1 + np.float32(self.camera) * rising, np.float32(MIN_VIEW_SHARE))
        return np.asarray(self.tilt / steep, np.float32)

    @cached_property
    def _planes(self) -> F4:
        """Height and slopes, 3 x H x W."""
        return np.concatenate([self.height[None], self.slope])

    def places_of(self, x: F8, y: F8) -> tuple[F8, F8]:
        """Return the places u, v in mm of columns x and rows y."""
        rows, columns = self.height.shape
        return (x - (columns - 1) / 2) * self.pixel, (y - (rows - 1) / 2) * self.pixel

    def at(self, u: NDArray[np.floating], v: NDArray[np.floating]) -> tuple[F8, F8, F8, F8]:
        """Return normals, 3 x N, and x, y, z in mm of the film at rest seen at places u, v."""
        rows, columns = self.height.shape
        down, across = v / self.pixel + (rows - 1) / 2, u / self.pixel + (columns - 1) / 2
        z, p, q = (
            map_coordinates(plane, (down, across), np.float64, order=1, mode="nearest")
            for plane in self._planes
        )
        n = np.stack([-p, -q, np.ones_like(p)])
        nearer = 1 - self.camera * z
        return n / np.sqrt((n * n).sum(0)), u * nearer, v * nearer, z

    def light(self, film: Film) -> F4:
        """Return F1 of the film at rest, K x H x W, over the light of a plane; without bounces."""
        u, v = self._places()
        z = self.height.ravel()
        nearer = 1 - np.float32(self.camera) * z
        p, q = self.slope.reshape(2, -1)
        nz = 1 / np.sqrt(1 + p * p + q * q)
        x, y = ((place + 0 * self.height).ravel() * nearer for place in (u, v))
        light = rest_share(film, np.stack([-p * nz, -q * nz, nz]), (x, y, z))
        return np.asarray(light.reshape(-1, *self.height.shape), np.float32)

    def binned(self, factor: int) -> Self:
        """Return the shape on cells of `factor` x `factor` pixels, whole ones alone."""
        if factor == 1:
            return self
        rows, columns = (side // factor for side in self.height.shape)
        whole = self.height[: rows * factor, : columns * factor]
        cells = cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA)
        return type(self)(np.asarray(cells, np.float32), self.pixel * factor, self.camera)

    def _places(self) -> tuple[F4, F4]:
        """u, 1 x W, and v, H x 1, in mm."""
        rows, columns = self.height.shape
        pixel = np.float32(self.pixel)
        return places(columns, pixel)[None], places(rows, pixel)[:, None]


def rest_share(film: Film, n: NDArray[np.floating], place: tuple[F8, F8, F8] | tuple[F4, F4, F4]) -> F8:
    """Return r of F5 without bounces: the film at rest, K x N, over a plane."""
    return np.asarray(predict(film._replace(gain=1.0), n, *place))
