"""Plots that compare two films."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tactograph.rings.recheck.nodes.film_change import FilmChange
from tactograph.sdk import F4, Colour, Light


def draw_films(
    films: dict[str, Light], change: FilmChange, words: str, *, width: float
) -> tuple[Figure, tuple[Axes, Axes]]:
    """Draw two films at rest, and maps of how they differ.

    Parameters
    ----------
    films : K x H x W, by title
    change : as `film_change` returns it
    words : which film is compared with which
    width : width of the figure, in inches

    Returns
    -------
    The figure, and the two empty axes on the right, upper and lower.
    """
    figure = Figure(figsize=(width, 8), dpi=100, layout="constrained")
    axes = figure.subplots(2, 3)
    means = {title: film.mean(axis=0) for title, film in films.items()}
    # From zero on, what LEDs leave uneven would not be seen.
    scale = {"vmin": np.min([*means.values()]), "vmax": np.max([*means.values()])}
    for place, (title, mean) in zip(axes[0], means.items(), strict=False):
        drawn = place.imshow(mean, cmap="gray", **scale)
        figure.colorbar(drawn, ax=place, label="of full scale")
        place.set(title=f"{title}, mean light", xlabel="x / px", ylabel="y / px")
    _draw_map(figure, axes[1, 0], 100 * change.albedo, f"albedo, {words} / %")
    _draw_map(figure, axes[1, 1], 1e3 * change.dent, f"height, {words} / um")
    return figure, (axes[0, 2], axes[1, 2])


def draw_light(axes: Axes, strength: F4, words: str) -> None:
    """Draw the brightness of each LED."""
    axes.bar([f"LED {k}" for k in range(1, len(strength) + 1)], 100 * strength, color=Colour.BLUE)
    axes.axhline(100, color="black", linewidth=0.5)
    axes.set_title(f"light of the LEDs, {words} / %")


def _draw_map(figure: Figure, axes: Axes, values: F4, title: str) -> None:
    """Draw a signed map, whose scale ignores the few strongest pixels."""
    most = float(np.percentile(np.abs(values), 99.8)) or 1.0
    drawn = axes.imshow(values, cmap="RdBu_r", vmin=-most, vmax=most)
    figure.colorbar(drawn, ax=axes)
    axes.set(title=title, xlabel="x / px", ylabel="y / px")
