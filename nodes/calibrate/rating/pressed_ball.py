"""The errors of slope and height in a contact with a ball of known radius."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, F8
from tactograph.nodes.optics.normals import angle_between

JUDGED_RADIUS_SHARE = 0.9
"""Share of the contact's radius that is judged, since pixels at the rim mix film and ball."""


class PressedBall(NamedTuple):
    """A ball's contact (x, y and radius in px), the ball's radius in px, and mm per px."""

    circle: F8
    radius: float
    pixel: float

    def shape(self, x: F8, y: F8) -> tuple[F8, F8]:
        """Return the slope (2 x N) and the height in mm above the contact's rim."""
        dx, dy, radius = x - self.circle[0], y - self.circle[1], self.radius
        z = np.sqrt(np.maximum(radius**2 - dx * dx - dy * dy, 1e-3 * radius**2))
        rim = np.sqrt(max(radius**2 - self.circle[2] ** 2, 0.0))
        return np.stack([-dx / z, -dy / z]), (z - rim) * self.pixel

    def errors(
        self, slope: F4, height: F4, judged: NDArray[np.bool_] | None = None
    ) -> tuple[float, float, float]:
        """Compare slope and height in the contact with the ball's.

        Parameters
        ----------
        slope, height : 2 x H x W, and H x W in mm
        judged : H x W, the pixels that are judged; None: all of the contact

        Returns
        -------
        Mean angle between normals in degrees; root mean square height error without its mean, in
        um; the same in per cent of the cap's height.  NaN where no pixel of the contact is judged.
        """
        x0, y0, contact = self.circle
        y, x = np.mgrid[: height.shape[0], : height.shape[1]].astype(np.float64)
        inside = np.hypot(x - x0, y - y0) < JUDGED_RADIUS_SHARE * contact
        if judged is not None:
            inside &= judged
        if not inside.any():
            return np.nan, np.nan, np.nan
        true, rise = self.shape(x[inside], y[inside])
        measured = slope[:, inside].astype(np.float64)
        angle = angle_between(measured, true)
        microns = float(1e3 * np.std(height[inside] - rise))
        cap = (self.radius - np.sqrt(max(self.radius**2 - contact**2, 0.0))) * self.pixel
        return float(np.degrees(angle.mean())), microns, microns / 10 / float(cap)
