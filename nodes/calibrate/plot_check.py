"""Show what has changed since a calibration."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tactograph.graph import Port, node
from tactograph.graph.files.whole_files import whole_file
from tactograph.nodes import F4, Height, Light
from tactograph.nodes.calibrate._film_pictures import draw_light, draw_map


@node
def plot_check(
    then: Light,
    now: Light,
    strength: Annotated[F4, Port("K", "1")],
    albedo: Annotated[F4, Port("H W", "1")],
    dent: Height,
    leds: str,
    film: str,
    lens: str,
    ambient: str,
    camera: str,
    *,
    file: Path,
) -> None:
    """Draw the film then and now, maps of albedo and dents, and the verdicts.

    Parameters
    ----------
    then, now
        K x H x W, the untouched film.
    strength, albedo, dent
        As `film_change` gives them.
    leds, film, lens, ambient, camera
        As `judge_film` gives them.
    file
        Where to.
    """
    figure = Figure(figsize=(13, 8), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 3)
    top = float(max(then.mean(axis=0).max(), now.mean(axis=0).max()))
    for place, frame, name in ((axes[0, 0], then, "at the calibration"), (axes[0, 1], now, "now")):
        place.imshow(frame.mean(axis=0), cmap="gray", vmin=0, vmax=top)
        place.set_title(f"untouched film {name}, mean light")
    draw_light(axes[0, 2], 100 * strength, "light of the LEDs, now against then / %")
    draw_map(figure, axes[1, 0], 100 * albedo, "albedo, now against then / %")
    draw_map(figure, axes[1, 1], 1e3 * dent, "height, now against then / um")
    axes[1, 2].axis("off")
    verdicts = {"LEDs": leds, "film": film, "lens": lens, "ambient light": ambient}
    lines = [f"{name}: {verdict}" for name, verdict in (verdicts | {"camera": camera}).items()]
    text = axes[1, 2].text(0, 1, "\n\n".join(lines), va="top", wrap=True, fontsize=9)
    text.set_parse_math(False)
    with whole_file(file) as target:
        figure.savefig(target, dpi=100, format="png")
