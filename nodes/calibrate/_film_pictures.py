"""Parts of the pictures that compare two films."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tactograph.nodes import F4

BLUE = "#3c8fe6"


def draw_map(figure: Figure, axes: Axes, values: F4, title: str) -> None:
    """Draw a signed map; a few strongest pixels do not set its scale."""
    most = float(np.percentile(np.abs(values), 99.8)) or 1.0
    drawn = axes.imshow(values, cmap="RdBu_r", vmin=-most, vmax=most)
    figure.colorbar(drawn, ax=axes)
    axes.set_title(title)


def draw_light(axes: Axes, percent: F4, title: str) -> None:
    """Draw a bar for each LED."""
    axes.bar([f"LED {k}" for k in range(1, len(percent) + 1)], percent, color=BLUE)
    axes.axhline(100, color="black", linewidth=0.5)
    axes.set_title(title)
