"""Errors of slope and height in a contact with a ball of known radius."""

import numpy as np
from numpy.typing import NDArray

from tactograph.nodes import F4, F8
from tactograph.nodes.optics.normals import angle_between

JUDGED_RADIUS_SHARE = 0.9
"""Share of the contact's radius that is judged, because pixels at the rim mix film and ball."""


def ball_shape(x: F8, y: F8, circle: F8, radius: float, pixel: float) -> tuple[F8, F8]:
    """Return the slope (2 x N) and the height in mm over the contact's rim; `radius` in px."""
    dx, dy = x - circle[0], y - circle[1]
    z = np.sqrt(np.maximum(radius**2 - dx * dx - dy * dy, 1e-3 * radius**2))
    rim = np.sqrt(max(radius**2 - circle[2] ** 2, 0.0))
    return np.stack([-dx / z, -dy / z]), (z - rim) * pixel


def judge_contact(
    slope: F4,
    height: F4,
    circle: F8,
    radius: float,
    pixel: float,
    judged: NDArray[np.bool_] | None = None,
) -> tuple[float, float, float]:
    """Compare slope and height in a contact (x, y, contact radius in px) with the ball's.

    Parameters
    ----------
    slope, height : 2 x H x W, and H x W in mm
    circle : x, y, contact radius in px
    radius, pixel : the ball's radius in px, mm per px
    judged : H x W, the pixels that are judged; None: all of the contact

    Returns
    -------
    Mean angle between normals in degrees; root mean square height error without its mean, in um;
    the same in per cent of the cap's height.  NaN where no pixel of the contact is judged.
    """
    y, x = np.mgrid[: height.shape[0], : height.shape[1]].astype(np.float64)
    inside = np.hypot(x - circle[0], y - circle[1]) < JUDGED_RADIUS_SHARE * circle[2]
    if judged is not None:
        inside &= judged
    if not inside.any():
        return np.nan, np.nan, np.nan
    true, rise = ball_shape(x[inside], y[inside], circle, radius, pixel)
    measured = slope[:, inside].astype(np.float64)
    angle = angle_between(measured, true)
    microns = float(1e3 * np.std(height[inside] - rise))
    cap = (radius - np.sqrt(max(radius**2 - circle[2] ** 2, 0.0))) * pixel
    return float(np.degrees(angle.mean())), microns, microns / 10 / float(cap)
