"""The film at rest if it is not a plane.

Light stays relative to a plane at height 0 under the same LEDs (N1, F1), which no camera has to
see: the flat frame divided by the model's light of the film at rest is the flat frame of a plane::

    flat_plane = flat / r,   r_k = F1(n_rest, P_rest) + B(P_rest)                          (F5)

So every formula holds for the film's absolute height, and none needs its shape.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, F8, Film
from tactograph.nodes.optics.block_sums import whole_cells
from tactograph.nodes.optics.difference import difference
from tactograph.nodes.optics.film import predict
from tactograph.nodes.optics.near_light import MIN_VIEW_SHARE, image_places
from tactograph.nodes.optics.normals import normals_of

MIN_REST_LIGHT = 0.02
"""Lower bound on the light of the film at rest, captured or over a plane's, in a denominator: light
of an LED that hardly reaches a place carries no information."""
REST_ROUNDS = 3
"""Rounds that find the light from film to film at rest, a few hundredths of the light."""
Numbers = NDArray[np.floating]


@dataclass(frozen=True)
class RestShape:
    """The film at rest at the places that the pixels see, H x W.

    Its height in mm, the height that the camera sees (V1), the slopes of both (2 x H x W), mm per
    px at height 0, and one over the height of the pupil.
    """

    height: F4
    apparent: F4
    slope: F4
    tilt: F4
    pixel: float
    camera: float

    @classmethod
    def of(cls, height: F4, pixel: float, camera: float = 0.0) -> Self:
        """Return the film at rest from its height, H x W in mm, that each pixel sees.

        `pixel` is in mm per px at height 0, `camera` one over the height of the pupil.
        """
        by = np.float32(camera)
        apparent = np.asarray(height / (1 - by * height), np.float32)
        p, q = tilt = np.stack([difference(apparent, axis) for axis in (1, 0)]) / np.float32(pixel)
        u, v = image_places(height.shape, pixel)
        slope = tilt / np.maximum(1 + by * (apparent - p * u - q * v), MIN_VIEW_SHARE)
        high, low, down, away = (
            np.asarray(each, np.float32) for each in (height, apparent, slope, tilt)
        )
        return cls(high, low, down, away, float(pixel), float(camera))

    def places_of(self, x: F8, y: F8) -> tuple[F8, F8]:
        """Return the places u, v in mm of columns x and rows y."""
        rows, columns = self.height.shape
        return (x - (columns - 1) / 2) * self.pixel, (y - (rows - 1) / 2) * self.pixel

    def at(self, u: Numbers, v: Numbers) -> tuple[F8, F8, F8, F8]:
        """Return normals, 3 x N, and x, y, z in mm of the film at rest seen at places u, v."""
        # Imported here: it takes 16 MB and a tenth of a start, and a plane film needs none of it.
        from scipy.ndimage import map_coordinates

        rows, columns = self.height.shape
        where = v / self.pixel + (rows - 1) / 2, u / self.pixel + (columns - 1) / 2
        z, p, q = (
            map_coordinates(plane, where, np.float64, order=1, mode="nearest")
            for plane in (self.height, *self.slope)
        )
        n, nearer = np.stack([-p, -q, np.ones_like(p)]), 1 - self.camera * z
        return n / np.sqrt((n * n).sum(0)), u * nearer, v * nearer, z

    def light(self, film: Film) -> F4:
        """Return r of F5 without bounces, K x H x W."""
        u, v = image_places(self.height.shape, self.pixel)
        nearer = 1 - np.float32(self.camera) * self.height
        place = (part.ravel() for part in (u * nearer, v * nearer, self.height))
        light = rest_share(film, normals_of(self.slope.reshape(2, -1)), *place)
        return np.asarray(light.reshape(-1, *self.height.shape), np.float32)

    def binned(self, factor: int) -> Self:
        """Return the means of complete cells of `factor` x `factor` pixels."""
        if factor == 1:
            return self
        return self._with(lambda planes: whole_cells(planes, factor), self.pixel * factor)

    def continued(self, factor: int) -> Self:
        """Return the shape continued to a multiple of `factor` pixels along both axes."""
        beyond = [(0, 0), *((0, -side % factor) for side in self.height.shape)]
        return self._with(lambda planes: np.pad(planes, beyond, mode="edge"), self.pixel)

    def _with(self, change: Callable[[F4], F4], pixel: float) -> Self:
        """Return the shape after a change of planes, N x H x W, with pixels of this size."""
        planes = np.stack([self.height, self.apparent, *self.slope, *self.tilt])
        height, apparent, *slopes = change(planes)
        slope, tilt = np.stack(slopes[:2]), np.stack(slopes[2:])
        return type(self)(height, apparent, slope, tilt, pixel, self.camera)


def rest_share(film: Film, n: Numbers, x: Numbers, y: Numbers, z: Numbers) -> F8:
    """Return r of F5 without bounces, K x N: F1 of untouched film with normals 3 x N."""
    return np.asarray(predict(film._replace(gain=1.0), n, x, y, z))
