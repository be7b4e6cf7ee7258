"""Print markers on a simulated film that is dragged sideways."""

from typing import Annotated

import numpy as np
from annotated_types import Ge, Interval

from tactograph.sdk import Close, Light, PixelSize, image_places, node


@node(neutral="light", tolerance=Close(2e-4, 1e-4, why="an exponential moves a marker's edge"))
def print_markers(
    light: Light,
    pixel: PixelSize,
    *,
    pitch_mm: Annotated[float, Ge(0.1)] = 1.5,
    radius_mm: Annotated[float, Ge(0.01)] = 0.3,
    dash_mm: Annotated[float, Ge(0)] = 0.0,
    contrast: Annotated[float, Interval(ge=0, le=1)] = 0.7,
    drag_x_mm: Annotated[float, Interval(ge=-5, le=5)] = 0.5,
    drag_y_mm: Annotated[float, Interval(ge=-5, le=5)] = 0.0,
    center_x_mm: Annotated[float, Interval(ge=-10, le=10)] = 0.0,
    center_y_mm: Annotated[float, Interval(ge=-10, le=10)] = 0.0,
    reach_mm: Annotated[float, Ge(0.1)] = 4.0,
) -> Light:
    """Return the light of a film printed with a square grid of dark dots or dashes.

    The print moves with the film.  The point seen at P lay at P - u before, where the drag u
    falls off as a Gaussian about a centre: u = drag exp(-|P - centre|^2 / (2 reach^2)).  So a
    marker at the grid position G is seen at the P for which P = G + u(P).

    Parameters
    ----------
    light : K x H x W
    pixel : mm per px
    pitch_mm : pitch of the grid, which has a marker in the middle of the image
    radius_mm, dash_mm : radius of a dot, and the length by which a dash is stretched along x
    contrast : share of the light that a marker absorbs
    drag_x_mm, drag_y_mm : drag of the film at the centre
    center_x_mm, center_y_mm : centre of the drag, from the middle of the image
    reach_mm : standard deviation of the drag's fall-off
    """
    side, pitch = np.float32(pixel), np.float32(pitch_mm)
    x, y = image_places(light.shape[1:], pixel)
    dx, dy = x - np.float32(center_x_mm), y - np.float32(center_y_mm)
    near = np.exp(-(dx * dx + dy * dy) / np.float32(2 * reach_mm * reach_mm))
    u, v = x - np.float32(drag_x_mm) * near, y - np.float32(drag_y_mm) * near
    u, v = u - pitch * np.rint(u / pitch), v - pitch * np.rint(v / pitch)
    u = np.maximum(np.abs(u) - np.float32(0.5 * dash_mm), np.float32(0))
    away = np.sqrt(u * u + v * v)
    covered = np.clip((np.float32(radius_mm) - away) / side + 0.5, 0, 1)
    return np.asarray(light * (1 - np.float32(contrast) * covered), np.float32)


print_markers.opencl(grid="K H W")
