"""Draw views and sweeps as data URIs, for a self-contained page."""

import base64
import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tactograph.graph.declare.ports import PortType
from tactograph.graph.show.colours import BIT_COLOURS, NO_BIT_COLOUR, SEVERAL_COLOUR, label_numbers
from tactograph.graph.show.figures import Estimate, words
from tactograph.graph.show.views import View, kind_of

LINE_COLOURS = (
    "#1f5fa8", "#d1495b", "#2d8a5f", "#b57614", "#6f4fa3", "#0f8b8d", "#8a5a44", "#a3306f",
)  # fmt: skip
MAX_PANELS_ACROSS = 4
"""Panels in a row."""
MAX_LOG_TICKS = 5
"""Most numbers on a logarithmic axis."""
PAGE_WIDTH_IN = 10.4
"""The width of a picture that fills the page."""
ERROR_PERCENTILE = 99.5
"""Percentile of the absolute errors at which the common scale ends; otherwise a few pixels on an
edge would leave all others white."""

BAR_LAYOUT: dict[str, Any] = {"fraction": 0.03, "pad": 0.015}
"""The width of a colour bar and its distance, as shares of the panels."""
LEGEND_STYLE: dict[str, Any] = {"frameon": False, "fontsize": 8}

Panels = Mapping[str, NDArray[Any]]
"""Arrays by title."""
Curve = tuple[Sequence[Any], Sequence[Estimate]]
"""Swept values and the figure at each; without values, one figure for the whole sweep."""


def png_of(name: str, port: PortType, array: NDArray[Any]) -> bytes | None:
    """A map, labels or a stack as a PNG; None for any other value."""
    kind = kind_of(port)
    is_stack = array.ndim == 3 and port.dims[-2:] == ("H", "W") and array.dtype.kind == "f"
    if not (kind or is_stack) or not array.size or not np.isfinite(array).any():
        return None
    if kind == "planes":
        uri = draw_planes(View(name, kind, port.unit, array))
    elif kind == "labels":
        uri = draw_labels({name: array}, port.unit)
    else:
        planes = {name: array} if array.ndim == 2 else dict(enumerate(array, start=1))
        panels = {str(title): plane for title, plane in planes.items()}
        uri = draw_maps(panels, f"{name} / {port.unit}")
    return base64.b64decode(uri.partition(",")[2])


def draw_planes(view: View) -> str:
    """Draw all planes of a stack beside each other, on one grey scale."""
    panels = {f"{k}": plane for k, plane in enumerate(view.array, start=1)}
    top = float(view.array.max(initial=0, where=np.isfinite(view.array)))
    return _png(_images(panels, cmap="gray", vmin=0, vmax=top))


def draw_maps(panels: Panels, unit: str) -> str:
    """Draw maps on one common scale."""
    everything = _finite(panels)
    low, high = float(everything.min(initial=np.inf)), float(everything.max(initial=-np.inf))
    return _maps(panels, unit, "viridis", Normalize(low, high), "neither")


def draw_errors(panels: Panels, unit: str) -> tuple[str, float]:
    """Draw differences from the truth on one common scale, white where there is none.

    Returns the picture, and the end of the scale.
    """
    everything = np.abs(_finite(panels))
    end = 1.0
    if everything.size:
        end = float(np.percentile(everything, ERROR_PERCENTILE)) or float(everything.max()) or end
    return _maps(panels, unit, "RdBu_r", Normalize(-end, end), "both"), end


def _finite(panels: Panels) -> NDArray[Any]:
    """All finite values."""
    everything = np.concatenate([array.ravel() for array in panels.values()])
    return np.asarray(everything[np.isfinite(everything)])


def draw_labels(panels: Panels, unit: str) -> str:
    """Draw labels in a colour for each bit, dark where several are set."""
    count = max(int(array.max()).bit_length() for array in panels.values()) or 1
    name = unit.removesuffix("bits").strip() or "bit"
    colours = ListedColormap([NO_BIT_COLOUR, *BIT_COLOURS[:count], SEVERAL_COLOUR])
    norm = BoundaryNorm(np.arange(-0.5, count + 2), colours.N)
    numbers = {title: label_numbers(array, count) for title, array in panels.items()}
    figure = _images(numbers, bar=True, cmap=colours, norm=norm, interpolation="nearest")
    scale = ScalarMappable(norm, colours)
    bar = figure.colorbar(scale, ax=figure.axes, ticks=np.arange(count + 2), **BAR_LAYOUT)
    bar.ax.set_yticklabels(["none", *(f"{name} {k + 1}" for k in range(count)), "several"])
    bar.ax.tick_params(length=0)
    return _png(figure)


def draw_section(panels: Panels, unit: str, row: int, truth: str | None) -> str:
    """Plot one row of every map, with the truth as a broad grey line, and the errors below."""
    figure = _figure(4.6 if truth else 3.4)
    if truth:
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        upper.plot(panels[truth][row], color="#bdbdbd", linewidth=4, label=truth)
        lower.axhline(0, color="#bdbdbd", linewidth=4)
    else:
        upper = lower = figure.subplots()
    runs = [title for title in panels if title != truth]
    for index, title in enumerate(runs):
        colour = LINE_COLOURS[index % len(LINE_COLOURS)]
        upper.plot(panels[title][row], color=colour, linewidth=1.2, label=title)
        if truth:
            lower.plot(panels[title][row] - panels[truth][row], color=colour, linewidth=1.2)
            lower.set_ylabel(f"error / {unit.rpartition('/')[2].strip()}")
    lower.set(xlabel="x / px", xlim=(0, next(iter(panels.values())).shape[1] - 1))
    upper.set_ylabel(unit)
    for ax in {upper, lower}:
        _plain(ax)
    upper.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), **LEGEND_STYLE)
    return _svg(figure)


def draw_curves(figures: Mapping[str, Mapping[str, Curve]], target: str, log: bool) -> str:
    """Plot figures over a swept parameter, a panel each, with 95 % confidence intervals."""
    across = min(3, len(figures))
    down = -(-len(figures) // across)
    figure = _figure(2.5 * down + 0.4)
    grid = figure.subplots(down, across, squeeze=False).ravel()
    for ax, (name, curves) in zip(grid, figures.items(), strict=False):
        for index, (label, curve) in enumerate(curves.items()):
            _draw_curve(ax, curve, label, LINE_COLOURS[index % len(LINE_COLOURS)])
        ax.set_title(words(name))
        ax.set_xlabel(target)
        if log:
            ax.set_xscale("log")
            places = sorted({value for values, _ in curves.values() for value in values})
            few = places[:: -(-len(places) // MAX_LOG_TICKS) or 1]
            ax.set_xticks(few, [f"{value:.3g}" for value in few])
            ax.minorticks_off()
        _plain(ax)
    for ax in grid[len(figures) :]:
        ax.set_axis_off()
    handles = {k: h for ax in grid for h, k in zip(*ax.get_legend_handles_labels(), strict=True)}
    figure.legend(
        handles.values(), handles.keys(), loc="outside upper left", ncols=4, **LEGEND_STYLE
    )
    return _svg(figure)


def _draw_curve(ax: Axes, curve: Curve, label: str, colour: str) -> None:
    values, estimates = curve
    means = [e.mean for e in estimates]
    if not values:
        ax.axhline(means[0], color=colour, linestyle="--", linewidth=1.2, label=label)
        ax.axhspan(estimates[0].low, estimates[0].high, color=colour, alpha=0.12, linewidth=0)
        return
    are_numbers = all(type(value) in (int, float) for value in values)
    x: list[Any] = list(values) if are_numbers else [str(value) for value in values]
    ax.plot(x, means, color=colour, marker="o", markersize=3.5, linewidth=1.3, label=label)
    lows, highs = [e.low for e in estimates], [e.high for e in estimates]
    ax.fill_between(x, lows, highs, color=colour, alpha=0.18, linewidth=0)


def _maps(panels: Panels, unit: str, colours: str, norm: Normalize, extend: str) -> str:
    figure = _images(panels, bar=True, cmap=colours, norm=norm)
    scale = ScalarMappable(norm, colours)
    bar = figure.colorbar(scale, ax=figure.axes, label=unit, extend=extend, **BAR_LAYOUT)
    bar.outline.set_linewidth(0.4)
    return _png(figure)


def _images(panels: Panels, bar: bool = False, **how: Any) -> Figure:
    """A figure with a bare panel for each array, in rows of equal size."""
    across = min(MAX_PANELS_ACROSS, len(panels))
    down = -(-len(panels) // across)
    rows, columns = next(iter(panels.values())).shape
    width = min(PAGE_WIDTH_IN, 4.6 * across)
    figure = _figure(down * (width * (0.9 if bar else 1) / across * rows / columns + 0.3), width)
    for ax in figure.subplots(down, across, squeeze=False).ravel():
        ax.set_axis_off()
    for ax, (title, array) in zip(figure.axes, panels.items(), strict=False):
        ax.imshow(array, **how)
        ax.set_title(title)
    return figure


def _figure(height: float, width: float = PAGE_WIDTH_IN) -> Figure:
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _plain(ax: Axes) -> None:
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(color="#e4e4e4", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.tick_params(labelsize=8)
    ax.title.set_fontsize(9)
    ax.xaxis.label.set_fontsize(8)
    ax.yaxis.label.set_fontsize(8)


def _png(figure: Figure) -> str:
    for ax in figure.axes:
        ax.title.set_fontsize(8.5)
        ax.tick_params(labelsize=8)
    figure.set_dpi(130)
    stream = io.BytesIO()
    # `savefig` draws twice.
    FigureCanvasAgg(figure).print_png(stream)  # type: ignore[no-untyped-call]
    return _uri(stream, "image/png")


def _svg(figure: Figure) -> str:
    stream = io.BytesIO()
    figure.draw_without_rendering()  # the layout depends on ticks, which the first drawing sets
    # Without a date, equal figures give an equal page.
    figure.savefig(stream, format="svg", metadata={"Date": None})
    return _uri(stream, "image/svg+xml")


def _uri(stream: io.BytesIO, media: str) -> str:
    return f"data:{media};base64,{base64.b64encode(stream.getvalue()).decode()}"
