"""A picture of a groove or step as ISO 5436-1 measures it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval

from tactograph.graph import node
from tactograph.nodes import UM_PER_MM, Height, Metrics, PixelSize
from tactograph.nodes.drawing.chart import BLUE, GREY, ORANGE, Page
from tactograph.nodes.drawing.new_picture import NewPicture, write_picture
from tactograph.nodes.metrology.measure_step import step_profiles


@node
def plot_step(
    height: Height,
    pixel: PixelSize,
    figures: Metrics,
    *,
    file: NewPicture | None = None,
    along: Literal["x", "y"] = "x",
    edges: Annotated[int, Interval(ge=1, le=2)] = 2,
    smooth_px: Annotated[int, Interval(ge=1, le=99)] = 5,
) -> None:
    """Draw the profile of median depth, both levels, the parts that make them, and the depth.

    What lies between these parts are the guard zones, which count for neither level.

    Parameters
    ----------
    height, pixel, along, edges, smooth_px
        As for `measure_step`.
    figures
        Of `measure_step`.
    file
        The picture (``.png``); None: none is drawn.
    """
    if file is None:
        return
    profiles = step_profiles(height, pixel, None, along, edges, smooth_px)
    shown = sorted(profiles, key=lambda profile: profile.depth)[len(profiles) // 2]
    x, z = pixel * shown.x, UM_PER_MM * shown.z
    depth, doubt = figures["step_depth_um"], figures["step_uncertainty_um"]
    title = f"{depth:.2f} ± {doubt:.2f} um by {len(profiles)} profiles; the middle one"
    space = 0.05 * float(np.nanmax(z) - np.nanmin(z))
    across, ends = (float(x[0]), float(x[-1])), (np.nanmin(z) - space, np.nanmax(z) + space)
    labels = f"{along} / mm", "height without the levels' slope / um"
    axes = Page(900, 400).axes(0, 0, across, ends, title, labels)
    half = UM_PER_MM * shown.depth / 2
    for part, level, colour in ((shown.upper, half, BLUE), (shown.lower, -half, ORANGE)):
        axes.area(np.where(part, x, np.nan), *ends, colour, opacity=0.15)
        axes.line(across, [level, level], colour)
    axes.line(x, z, GREY)
    for part, colour in ((shown.upper, BLUE), (shown.lower, ORANGE)):
        axes.line(np.where(part, x, np.nan), z, colour, width=2)
    middle = float(np.mean(x[shown.lower]))
    axes.arrows([middle, middle], [0, 0], [0, 0], [-half, half], "black")
    write_picture(axes.page, Path(file))
