"""Draw the film at rest of a calibration, and a plot of its lights that depends on its kind."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure


def draw_sensor(
    arrays: Mapping[str, Any],
    title: str,
    target: Path,
    draw_lights: Callable[[SubFigure, Mapping[str, Any]], None],
) -> None:
    """Draw the film at rest under each LED, and below it the plot of `draw_lights`."""
    flat = arrays["flat"]
    figure = Figure(figsize=(3 * len(flat), 7), dpi=100, layout="constrained")
    grid = figure.add_gridspec(2, 1)
    upper, lower = figure.add_subfigure(grid[0]), figure.add_subfigure(grid[1])
    for k, (axes, plane) in enumerate(zip(upper.subplots(1, len(flat)), flat, strict=True)):
        # On a scale from zero, uneven light would not be visible.
        drawn = axes.imshow(plane, cmap="gray")
        axes.set(title=f"film at rest, LED {k + 1}", xlabel="x / px", ylabel="y / px")
        figure.colorbar(drawn, ax=axes, orientation="horizontal", label="of full scale")
    draw_lights(lower, arrays)
    figure.suptitle(title)
    FigureCanvasAgg(figure).print_png(target)
