"""The picture of a stitched surface and its seams."""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tactograph.sdk import F4, Labels


def draw_seams(height: F4, source: Labels, pixel: float, file: Path) -> None:
    """The surface lit from the upper left, and the seams between the touches it is made of."""
    down, right = np.gradient(height, pixel)
    lit = (1 - right - down) / np.sqrt(1 + right**2 + down**2)
    figure = Figure(figsize=(6.4, 4.6), dpi=110)
    figure.subplots_adjust(left=0.1, right=0.97, bottom=0.12, top=0.92)
    axes = figure.subplots()
    x, y = (pixel / 2 * size for size in height.shape[::-1])
    extent = (-x, x, y, -y)
    axes.imshow(lit, cmap="gray", extent=extent)
    edges = (np.diff(source.astype(int), axis=0)[:, 1:] != 0) | (
        np.diff(source.astype(int))[1:] != 0
    )
    axes.imshow(
        np.ma.masked_equal(edges, False), cmap="autumn", extent=extent, interpolation="none"
    )
    count = len(np.unique(source[source > 0]))
    axes.set(xlabel="x / mm", ylabel="y / mm", title=f"{count} touches and their seams")
    FigureCanvasAgg(figure).print_png(file)
