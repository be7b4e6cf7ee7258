"""A picture of a groove or step as ISO 5436-1 measures it."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tactograph.rings.metrology.nodes.surface.measure_step import Across, EdgeCount, step_profiles
from tactograph.sdk import Colour, Height, NewPicture, PixelSize, node


@node
def plot_step(
    height: Height,
    pixel: PixelSize,
    figures: dict[str, float],
    *,
    file: Path | None = None,
    along: Across = "x",
    edges: EdgeCount = 2,
) -> None:
    """Draw the profile of median depth, both levels, the parts that make them, and the depth.

    What lies between these parts are the guard zones, which count for neither level.

    Parameters
    ----------
    height : H x W in mm
    pixel : mm per px
    along, edges : as for `measure_step`
    figures : of `measure_step`
    file : the picture (``.png``); None: none is drawn
    """
    if file is None:
        return
    profiles = step_profiles(height, pixel, None, along, edges)
    median_profile = sorted(profiles, key=lambda profile: profile.depth)[len(profiles) // 2]
    x, z = pixel * median_profile.x, 1e3 * median_profile.z
    figure = Figure(figsize=(9, 4), dpi=100, layout="constrained")
    axes = figure.subplots()
    axes.plot(x, z, color=Colour.GREY, linewidth=1)
    half = 1e3 * median_profile.depth / 2
    for part, level, colour in (
        (median_profile.upper, half, Colour.BLUE),
        (median_profile.lower, -half, Colour.ORANGE),
    ):
        shaded = axes.fill_between(x, 0, 1, where=part, color=colour, alpha=0.15, linewidth=0)
        shaded.set_transform(axes.get_xaxis_transform())
        axes.axhline(level, color=colour, linewidth=1, linestyle="--")
        axes.plot(np.where(part, x, np.nan), z, color=colour, linewidth=2)
    middle = float(np.mean(x[median_profile.lower]))
    axes.annotate("", (middle, -half), (middle, half), arrowprops={"arrowstyle": "<->"})
    axes.set(xlabel=f"{along} / mm", ylabel="height without the levels' slope / µm")
    depth, error = figures["step_depth_um"], figures["step_uncertainty_um"]
    axes.set_title(f"{depth:.2f} ± {error:.2f} µm by {len(profiles)} profiles; the middle one")
    NewPicture(file).write(figure)
