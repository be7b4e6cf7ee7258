"""Places on the film that a camera's pixels see, and a regular grid of them.

A camera whose pupil is D above the film sees a point of height z that lies at (u, v) (1 - z / D)
where it sees the place (u, v) of the film at rest.  Its lens moves that place in the image
(`optics.lens`).  Places are in pixels of the ideal image, from the image's middle.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError
from tactograph.nodes import F4, Height, Lens
from tactograph.nodes.optics.bicubic import between_pixels
from tactograph.nodes.optics.lens import camera_offset, half_diagonal, ideal_places, is_straight

BISECTION_STEPS = 10
"""Bisections of the interval that holds the pixel which sees a point of the grid."""

Places = NDArray[Any]


def film_places(
    height: Height, lens: Lens | None, camera: float, step: int = 1
) -> tuple[Places, Places]:
    """Return x and y, in ideal pixels from the image's middle, of the points that pixels see.

    Parameters
    ----------
    height : H x W in mm, as seen
    lens : length 8; None: no distortion
    camera : 1 / D in 1/mm; 0: orthographic
    step : spacing in px of the rows and columns whose points are wanted

    Raises
    ------
    InputError
        If the film rises to the camera.
    """
    _check_below(height, camera)
    rows, columns = height.shape
    if lens is None or is_straight(lens):
        row, column = np.mgrid[:rows:step, :columns:step].astype(np.float64)
    else:
        column, row = (p.astype(np.float64) for p in ideal_places(lens, height.shape, step))
    nearer = 1 - height[::step, ::step].astype(np.float64) * camera
    middle = (columns - 1) / 2, (rows - 1) / 2
    return (column - middle[0]) * nearer, (row - middle[1]) * nearer


def film_areas(x: Places, y: Places) -> Places:
    """Return how much film each pixel sees from above, in ideal pixels: from `film_places`."""
    (x_down, x_right), (y_down, y_right) = np.gradient(x), np.gradient(y)
    return np.asarray(x_right * y_down - x_down * y_right)


def on_even_grid(
    height: Height, others: list[F4], lens: Lens | None, camera: float
) -> tuple[Height, list[F4]]:
    """Return the height, and other maps, on the ideal image's grid on the film.

    For each point of the grid, a search along the line to the image's middle finds the pixel
    that sees a point above it.  NaN where no pixel does: at the border.

    Parameters
    ----------
    height, lens, camera : as for `film_places`
    others : H x W each, interpolated linearly

    Raises
    ------
    InputError
        If the film rises to the camera.
    """
    _check_below(height, camera)
    lens = np.zeros(8, np.float32) if lens is None else lens
    if is_straight(lens) and camera == 0:
        return height, others
    rows, columns = height.shape
    half = float(half_diagonal(height.shape))
    row, column = np.mgrid[:rows, :columns].astype(np.float64)
    u, v = (column - (columns - 1) / 2) / half, (row - (rows - 1) / 2) / half

    def places(stretch: Places) -> tuple[Places, Places]:
        du, dv = camera_offset(lens.astype(np.float64), u * stretch, v * stretch)
        x, y = (u * stretch + du) * half, (v * stretch + dv) * half
        return x + (columns - 1) / 2, y + (rows - 1) / 2

    low = np.full(u.shape, 1 / (1 - camera * min(float(height.min()), 0.0)))
    high = np.full(u.shape, 1 / (1 - camera * max(float(height.max()), 0.0)))
    for _ in range(BISECTION_STEPS if camera else 0):
        middle = (low + high) / 2
        is_beyond = middle * (1 - camera * _linear(height, *places(middle))) - 1 > 0
        low, high = np.where(is_beyond, low, middle), np.where(is_beyond, middle, high)
    x, y = places((low + high) / 2)
    inside = (x >= 0) & (x <= columns - 1) & (y >= 0) & (y <= rows - 1)
    heights = between_pixels(height, x.astype(np.float32), y.astype(np.float32))
    nowhere = np.float32(np.nan)
    maps = [np.float32(_linear(other, x, y)) for other in others]
    return np.where(inside, heights, nowhere), [np.where(inside, m, nowhere) for m in maps]


def _linear(plane: F4, x: Places, y: Places) -> Places:
    from scipy.ndimage import map_coordinates  # takes 0.3 s; not needed without lens and camera

    return np.asarray(map_coordinates(plane, (y, x), order=1, mode="nearest"))


def _check_below(height: Height, camera: float) -> None:
    highest = float(height.max())
    if camera * highest >= 1:
        raise InputError(
            f"the film rises to {highest:.3g} mm, but the camera's pupil is {1 / camera:.3g} mm "
            "above it; check its height in the calibration"
        )
