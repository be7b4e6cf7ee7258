"""Show what the calibration saw, so that a person can tell a good one from a bad one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tactograph.graph import node
from tactograph.graph.whole import whole_file
from tactograph.nodes import (
    Labels,
    Light,
    LutSlope,
    Mask,
    Metrics,
    NullVector,
    Reflectance,
    Slope,
    Spread,
)
from tactograph.nodes.fit_reflectance import harmonics


@node
def plot_calibration(
    light: Light,
    mask: Mask,
    slope: Slope,
    lit: Labels,
    lut_slope: LutSlope,
    reflectance: Reflectance,
    null: NullVector,
    spread: Spread,
    quality: Metrics,
    *,
    file: Path,
) -> None:
    """Draw the object found, the tables' coverage, the fit's residual and the null test.

    Parameters
    ----------
    light, mask, slope, lit
        Of the calibration object.
    lut_slope
        N x 2, the slopes in the tables.
    reflectance, null, spread
        The fits.
    quality
        The figures of `rate_calibration`, for the title.
    file
        The picture goes beside it: ``cal.npz`` gives ``cal.png``.
    """
    figure = Figure(figsize=(11, 8), layout="constrained")
    FigureCanvasAgg(figure)
    (found, coverage), (residual, histogram) = figure.subplots(2, 2)
    _draw_found(found, light, mask)
    _draw_coverage(coverage, lut_slope)
    _draw_residual(figure, residual, light, mask, slope, lit, reflectance)
    _draw_null(histogram, light, mask, lit, null, spread)
    figure.suptitle(_title(quality), fontsize=9)
    with whole_file(file.with_suffix(".png")) as target:
        figure.savefig(target, dpi=100)


def _title(quality: Metrics) -> str:
    """The figures that are not of one LED alone."""
    return "  ".join(f"{name} {value:.4g}" for name, value in quality.items() if "/" not in name)


def _draw_found(axes: Axes, light: Light, mask: Mask) -> None:
    axes.imshow(light.mean(axis=0), cmap="gray")
    axes.contour(mask, levels=[0.5], colors=["#ffb000"], linewidths=1)
    axes.set(title="mean light, and the pixels of known slope", xlabel="x / px", ylabel="y / px")


def _draw_coverage(axes: Axes, lut_slope: LutSlope) -> None:
    axes.hexbin(lut_slope[:, 0], lut_slope[:, 1], gridsize=60, bins="log", cmap="viridis")
    axes.set_aspect("equal")
    axes.set(title=f"slopes in the tables ({len(lut_slope)} pixels)", xlabel="p", ylabel="q")


def _draw_residual(
    figure: Figure,
    axes: Axes,
    light: Light,
    mask: Mask,
    slope: Slope,
    lit: Labels,
    reflectance: Reflectance,
) -> None:
    model = np.tensordot(reflectance, harmonics(slope), axes=1)
    error = np.zeros(mask.shape, np.float32)
    for k, plane in enumerate(light):
        used = (mask > 0) & ((lit >> k) & 1 > 0)
        error = np.maximum(error, np.where(used, np.abs(plane - model[k]), 0))
    drawn = axes.imshow(np.ma.masked_where(mask == 0, error), cmap="magma", vmin=0)
    figure.colorbar(drawn, ax=axes)
    axes.set(
        title="largest |I - R| of the LEDs that reach the pixel", xlabel="x / px", ylabel="y / px"
    )


def _draw_null(
    axes: Axes, light: Light, mask: Mask, lit: Labels, null: NullVector, spread: Spread
) -> None:
    if spread == 0:
        axes.text(0.5, 0.5, "three LEDs:\nno shadow test", ha="center", va="center")
        axes.set_axis_off()
        return
    chosen = (mask > 0) & (lit == (1 << len(light)) - 1)
    departure = np.tensordot(null, light, axes=1)[chosen] / spread
    axes.hist(np.clip(departure, -10, 10), bins=100, color="#3c8fe6")
    for threshold in (-3, 3):
        axes.axvline(threshold, color="#d1495b", linewidth=1)
    axes.set(title="a.I on lit pixels, in multiples of its spread", xlabel="a.I / spread")
