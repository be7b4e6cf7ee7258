"""Convert a film rendered from straight above to the view of a near camera."""

import math
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Ge, Interval
from numpy.typing import NDArray

from tactograph.graph import Close, InputError, node
from tactograph.graph.backends.launch import Launch
from tactograph.nodes import F4, Height, Labels, Light, Slope
from tactograph.nodes.optics.bilinear import bilinear

BISECTION_STEPS = 24
"""Bisections of a step; this many reach the precision of a float32."""


class Viewed(NamedTuple):
    """The images, and the ground truth at each of their pixels."""

    light: Light
    height: Height
    slope: Slope
    labels: Labels


@node(
    tolerance=Close(
        2e-5, 2e-4, share=2e-3, why="a ray of sight that grazes an edge may fall either way"
    )
)
def view(
    light: Light,
    height: Height,
    slope: Slope,
    labels: Labels,
    *,
    camera_mm: Annotated[float, Ge(0)] = 0.0,
    lens_at_corner: Annotated[float, Interval(ge=-0.3, le=0.3)] = 0.0,
) -> Viewed:
    """Return images, height, slope and labels as the pixels of a real camera see them.

    The pupil is above the middle of the image.  A pixel that sees (u, v) on the film at rest
    sees (u f, v f, z), f = 1 - z / camera_mm, where its line of sight first meets the film.  So
    high parts look larger and hide what lies behind them.  The lens makes the pixel at (x, y)
    see ``(u, v) = (x, y) (1 + lens_at_corner (r^2 - 1/2))``, with r = 1 in the corner.

    Parameters
    ----------
    light : K x H x W, from straight above
    height : H x W in mm
    slope : 2 x H x W
    labels : H x W
    camera_mm : distance of the pupil from the film at rest; 0 is infinitely far away
    lens_at_corner
        Twice the distortion in the corner, relative to the distance from the middle; it is 0 at
        r^2 = 1/2.  Below 0 a pincushion, above 0 a barrel.

    Raises
    ------
    InputError
        If the pupil is not above the film (NumPy; the kernel cannot refuse).
    """
    top, bottom = height.max(), height.min()
    if 0 < camera_mm <= top:
        raise InputError(
            f"view: the camera stands {camera_mm:g} mm above the film at rest, which rises to "
            f"{top:g} mm; raise the camera (0 is infinitely far)"
        )
    rows, columns = height.shape
    u, v = _apparent_places(rows, columns, np.float32(lens_at_corner))
    if camera_mm:
        x, y = _met(height, u, v, (bottom, top), np.float32(camera_mm))
    else:
        x, y = _places(u, v, (rows, columns))
    nearest = _rounded(y, rows), _rounded(x, columns)
    return Viewed(
        np.stack([bilinear(plane, x, y) for plane in light]),
        bilinear(height, x, y),
        np.stack([bilinear(plane, x, y) for plane in slope]),
        labels[nearest],
    )


@view.opencl()
def _launch(run: Launch) -> None:
    count, *size = (run.sizes[symbol] for symbol in "KHW")
    names = "light", "height", "slope", "labels"
    light, height, slope, labels = (run.inputs[name] for name in names)
    rows, ends = run.scratch((2 * size[0],)), run.scratch((2,))
    run.kernel("row_ends", (size[0],), height, rows, *size)
    run.kernel("ends", (1,), rows, ends, size[0])
    settings = (run.settings[name] for name in view.parameters)
    outputs = (run.outputs[name] for name in names)
    arguments = light, height, slope, labels, ends, *outputs, count, *size, *settings
    run.kernel("view", (size[0], size[1]), *arguments)


def _apparent_places(rows: int, columns: int, lens: np.float32) -> tuple[F4, F4]:
    """Return the positions on the film at rest that the pixels see, in px from the middle."""
    half = np.float32(0.5)
    y, x = np.indices((rows, columns)).astype(np.float32)
    left, above = half * np.float32(columns - 1), half * np.float32(rows - 1)
    x, y = x - left, y - above
    corner = np.maximum(left * left + above * above, np.float32(1))
    gain = np.float32(1) + lens * ((x * x + y * y) / corner - half)
    return x * gain, y * gain


def _places(u: F4, v: F4, size: tuple[int, int]) -> tuple[F4, F4]:
    """Return columns and rows of positions given from the middle."""
    half = np.float32(0.5)
    return u + half * np.float32(size[1] - 1), v + half * np.float32(size[0] - 1)


def _met(
    height: F4, u: F4, v: F4, ends: tuple[np.float32, np.float32], camera: np.float32
) -> tuple[F4, F4]:
    """Follow the lines of sight down from the highest point; return where they meet the film."""
    bottom, top = ends
    rows, columns = height.shape

    def places(z: F4) -> tuple[F4, F4]:
        nearer = np.float32(1) - z / camera
        return _places(u * nearer, v * nearer, (rows, columns))

    # So many that none moves more than half a pixel over the film.
    diagonal = 0.5 * math.hypot(rows - 1, columns - 1)
    steps = 1 + math.ceil(2 * diagonal * float(top - bottom) / float(camera))
    above, below = np.full_like(height, top), np.full_like(height, bottom)
    open_ = np.ones(height.shape, bool)
    for i in range(1, steps):
        z = np.full_like(height, top - (top - bottom) * np.float32(i / steps))
        met = open_ & (bilinear(height, *places(z)) >= z)
        below[met] = z[met]
        open_ &= ~met
        above[open_] = z[open_]
    for _ in range(BISECTION_STEPS):
        z = np.float32(0.5) * (above + below)
        met = bilinear(height, *places(z)) >= z
        below, above = np.where(met, z, below), np.where(met, above, z)
    return places(below)


def _rounded(place: F4, count: int) -> NDArray[np.intp]:
    return np.clip(np.floor(place + np.float32(0.5)), 0, count - 1).astype(np.intp)
