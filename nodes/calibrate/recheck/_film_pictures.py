"""Plots that compare two films."""

import numpy as np

from tactograph.nodes import F4, Height, Light
from tactograph.nodes.drawing.chart import Page, pixel_ends

HEIGHT_PX = 800
MAP_PERCENTILE = 99.8
"""The scale of a map ignores the pixels that are stronger."""


def draw_films(
    films: dict[str, Light], albedo: F4, dent: Height, words: str, *, width: int, title: str = ""
) -> Page:
    """Draw two films at rest, and maps of how they differ; the third column is left free.

    Parameters
    ----------
    films
        K x H x W, by title.
    albedo, dent
        As `film_change` returns them.
    words
        Which film is compared with which.
    width, title
        Of the page; the width in px.
    """
    page = Page(width, HEIGHT_PX, 2, 3, title)
    means = {name: film.mean(axis=0) for name, film in films.items()}
    top = max(float(mean.max()) for mean in means.values())
    for column, (name, mean) in enumerate(means.items()):
        axes = page.axes(0, column, *pixel_ends(mean), f"{name}, mean light", square=True)
        axes.image(mean, ends=(0, top))
    _draw_map(page, 0, 100 * albedo, f"albedo, {words} / %")
    _draw_map(page, 1, 1e3 * dent, f"height, {words} / um")
    return page


def draw_light(page: Page, row: int, percent: F4, words: str) -> None:
    """Draw the brightness of each LED into the third column."""
    ends, top = (0.5, len(percent) + 0.5), 1.05 * max(100, float(percent.max(initial=0)))
    names = {k: f"LED {k}" for k in range(1, len(percent) + 1)}
    title = f"light of the LEDs, {words} / %"
    axes = page.axes(row, 2, ends, (0, top), title, names=(names, None))
    for k, share in enumerate(percent, start=1):
        axes.area([k - 0.4, k + 0.4], 0, share)
    axes.line(ends, [100, 100], "black")


def _draw_map(page: Page, column: int, values: F4, title: str) -> None:
    most = float(np.percentile(np.abs(values), MAP_PERCENTILE)) or 1.0
    axes = page.axes(1, column, *pixel_ends(values), title, square=True, bar=True)
    axes.image(values, "signed", (-most, most))
    axes.colour_bar()
