"""Find the directions to lamps by their highlights on a mirror ball."""

from pathlib import Path
from typing import Annotated

import numpy as np
from annotated_types import Gt
from scipy.ndimage import label

from tactograph.rings.without_ball.nodes.read_lamps import far_lamps
from tactograph.sdk import F4, InputError, Layout, LightPositions, node

BALL_SHARE = 0.98
"""Share of the ball's radius in which highlights are searched for."""
HIGHLIGHT_SHARE = 0.5
"""Light of a highlight, over its brightest pixel."""
MIN_LIGHT, MAX_AREA_SHARE, MAX_DULL_SHARE = 0.1, 0.1, 0.25
"""Smallest light of a highlight, as a share of full scale, its largest share of the ball, and the
largest light of nine tenths of the ball, over that of the highlight: a dull ball has more."""


@node
def find_highlights(
    *,
    folder: Path,
    center_px: tuple[float, float],
    radius_px: Annotated[float, Gt(1)],
    layout: Layout,
) -> LightPositions:
    """Return a place far away in the direction of each lamp, K x 3 in mm.

    A mirror turns the view (0, 0, 1) into 2 n_z n - (0, 0, 1), where n is the normal of the ball
    at the highlight.  What all images show counts as surroundings.

    Parameters
    ----------
    folder : a capture of a ball that mirrors, one image per lamp
    center_px, radius_px : middle and radius of the ball's outline, in px of the (cropped) image
    layout : as for `read_capture`, one image per lamp

    Raises
    ------
    InputError
        If a lamp makes no highlight on the ball, the outline lies beside the image, or two images
        differ in size.
    """
    files = layout.led_files(folder)
    planes = [layout.plane(file) for file in files.values()]
    if len({plane.shape for plane in planes}) > 1:
        raise InputError(f"{folder}: the images differ in size")
    y, x = np.indices(planes[0].shape)
    nx, ny = (x - center_px[0]) / radius_px, (y - center_px[1]) / radius_px
    on_ball = np.hypot(nx, ny) < BALL_SHARE
    if not on_ball.any():
        raise InputError(f"`center_px`={center_px[0]:g},{center_px[1]:g}: lies beside the image")
    lit = np.stack(planes) - np.min(planes, axis=0)
    directions = []
    for led, light in zip(files, lit, strict=True):
        weight = _highlight(np.where(on_ball, light, np.float32(0)))
        brightest = float(weight.max())
        is_dull = np.percentile(light[on_ball], 90) > MAX_DULL_SHARE * brightest
        is_wide = np.count_nonzero(weight) > MAX_AREA_SHARE * on_ball.sum()
        if brightest < MIN_LIGHT or is_dull or is_wide:
            raise InputError(
                f"{files[led]}: LED {led} makes no highlight on the ball: check `center_px` and "
                "`radius_px`, that the ball mirrors, and that other light is kept out"
            )
        u, v = (float(np.average(n, weights=weight)) for n in (nx, ny))
        w = np.sqrt(1 - u * u - v * v)
        directions.append((2 * w * u, 2 * w * v, 2 * w * w - 1))
    return far_lamps(np.array(directions))


def _highlight(light: F4) -> F4:
    """The light of the brightest spot, 0 elsewhere."""
    spots, _ = label(light >= HIGHLIGHT_SHARE * light.max())
    spot = spots[np.unravel_index(int(light.argmax()), light.shape)]
    return np.where(spots == spot, light, np.float32(0))
