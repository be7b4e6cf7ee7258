"""A ball pressed into a film that is no plane at rest, as the camera sees it."""

from typing import NamedTuple

import numpy as np

from tactograph.nodes import F4, F8
from tactograph.nodes.calibrate.ball.ball_search import Circle
from tactograph.nodes.calibrate.ball.ball_slopes import BallSlopes
from tactograph.nodes.calibrate.ball.ball_surface import away_on, ball_height
from tactograph.nodes.optics.rest_shape import RestShape

MARGIN_PX = 0.5
"""Width of the rim that is left out, because its pixels mix ball and film."""
MIN_FACING = 0.02
"""Smallest n_z of a ball."""


class BallPlace(NamedTuple):
    """A ball's centre and the radius of its contact with a plane through the film there, in mm."""

    x: float
    y: float
    z: float
    rim: float


class BallOnShape(NamedTuple):
    """A ball of `radius` mm on a film."""

    shape: RestShape
    radius: float

    def normals_at(self, x: F8, y: F8, circle: Circle, radius_px: float) -> tuple[list[F8], F8]:
        """Return the ball's normals, and how far from the middle pixels count as, in px.

        A pixel lies as far from the middle as on a plane the ball rises as high above the film.
        `radius_px` is that of the ball.
        """
        shrink = self.radius / radius_px / self.shape.pixel
        u, v = self.shape.places_of((x + 0.5) * shrink - 0.5, (y + 0.5) * shrink - 0.5)
        at = place_on(self.shape, circle.on(1 / shrink), self.radius)
        camera = self.shape.camera
        z = ball_height(u, v, (at.x, at.y, at.z), self.radius, camera)
        dx, dy = u * (1 - camera * z) - at.x, v * (1 - camera * z) - at.y
        rest = self.shape.at(u, v)[3]
        base = at.z + np.sqrt(max(self.radius**2 - at.rim**2, 0.0))
        centre = at.x, at.y, at.z
        away = away_on(u, v, rest, base, centre, self.radius, camera)
        normal = [part / self.radius for part in (dx, dy, np.maximum(z - at.z, 0))]
        return normal, away * circle.radius / max(at.rim, 1e-9)

    def slopes(self, circle: Circle) -> BallSlopes:
        """Return the slope and height of a ball within its contact."""
        rows, columns = self.shape.height.shape
        y, x = np.mgrid[:rows, :columns].astype(np.float64)
        (nx, ny, nz), away = self.normals_at(
            x.ravel(), y.ravel(), circle, self.radius / self.shape.pixel
        )
        inside = (away < circle.radius - MARGIN_PX) & (nz > MIN_FACING)
        up = np.where(inside, nz, 1)
        at = place_on(self.shape, circle, self.radius)
        slope = np.stack([-nx / up, -ny / up]) * inside
        height = np.where(inside, at.z + self.radius * nz, 0)
        return BallSlopes(
            slope.reshape(2, rows, columns).astype(np.float32),
            inside.reshape(rows, columns).astype(np.uint8),
            height.reshape(rows, columns).astype(np.float32),
        )


def place_on(shape: RestShape, circle: Circle | F4, radius_mm: float) -> BallPlace:
    """Return where a ball lies whose circle, in px, is seen on a film of this shape."""
    column, row, contact = (float(part) for part in circle)
    u, v = shape.places_of(np.array([column]), np.array([row]))
    _, x, y, z = (np.ravel(part)[-1] for part in shape.at(u, v))
    rim = min(contact * shape.pixel * (1 - shape.camera * z), radius_mm)
    return BallPlace(float(x), float(y), float(z - np.sqrt(radius_mm**2 - rim**2)), rim)
