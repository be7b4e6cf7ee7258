"""Draw the pictures of a result, for people."""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import BoundaryNorm, ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from tactograph.graph.cache.keys import content_key
from tactograph.graph.show.colours import BIT_COLOURS, SEVERAL_COLOUR, label_numbers
from tactograph.nodes import BAND_DEVIATIONS, F4, Contacts, Height, HeightError, Labels
from tactograph.nodes.files.image_files import ImageFile
from tactograph.nodes.files.layer_files import picture_file
from tactograph.nodes.stream.touch import ColourMap, LabelMap, Touch

# Fixed margins and `print_png` take half the time of a layout that measures every text, and of
# `savefig`, which draws twice.
DPI = 110
OUTER_PERCENT = 0.1
"""Percentage of pixels on either side that the colour scale may leave out as outliers."""


def draw_result(touch: Touch, folder: Path) -> None:
    """Draw the height, and every layer that is a map or drawn over the image."""
    _once(folder / "height.png", draw_height, touch.height, touch.deviation, touch.pixel)
    count, grey = touch.image.shape[0], touch.image.mean(axis=0)
    for layer in touch.each_layer():
        match layer.kind.drawn:
            case ColourMap() as how:
                _once(picture_file(layer, folder), draw_map, layer.value, how, touch.pixel)
            case LabelMap(title, leds=True):
                _once(picture_file(layer, folder), draw_labels, layer.value, grey, count, title)
            case LabelMap(title):
                _once(picture_file(layer, folder), draw_regions, layer.value, grey, title)


def _once(file: Path, draw: Callable[..., None], *arguments: Any) -> None:
    """Draw into a file; if this thread's last picture of that name is the same, copy that."""
    last: dict[str, tuple[str, bytes]] = _mine.__dict__.setdefault("last", {})
    key = content_key(*(part if isinstance(part, np.ndarray) else repr(part) for part in arguments))
    drawn = last.get(file.name)
    if drawn is not None and drawn[0] == key:
        file.write_bytes(drawn[1])
        return
    draw(*arguments, file)
    last[file.name] = key, file.read_bytes()


def draw_height(height: Height, error: HeightError | None, pixel: float, file: Path) -> None:
    """Draw the height map in mm, and a section through its highest point with its error."""
    rows, columns = height.shape
    figure = Figure(figsize=(10, 4), dpi=DPI)
    figure.subplots_adjust(left=0.06, right=0.985, bottom=0.13, top=0.91, wspace=0.2)
    left, right = figure.subplots(1, 2, width_ratios=(1.25, 1))
    picture, span = _coloured(left, height, ColourMap("height", "mm"), pixel)
    coloured = np.where(height <= picture.get_clim()[1], height, -np.inf)
    top = int(np.unravel_index(int(coloured.argmax()), height.shape)[0])
    y = (top - (rows - 1) / 2) * pixel
    left.axhline(y, color="white", linewidth=0.7, linestyle="--")
    left.set(xlabel="x / mm", ylabel="y / mm", title=f"height{span}")
    figure.colorbar(picture, ax=left, label="mm")
    across = (np.arange(columns) - (columns - 1) / 2) * pixel
    right.plot(across, height[top], linewidth=1)
    if error is not None:
        half = BAND_DEVIATIONS * error[top]
        right.fill_between(across, height[top] - half, height[top] + half, alpha=0.35, label="90 %")
        right.legend(loc="upper right")
    right.set(xlabel="x / mm", ylabel="height / mm", title=f"section at y = {y:.2f} mm")
    right.grid(alpha=0.3)
    FigureCanvasAgg(figure).print_png(file)


def draw_map(plane: F4, how: ColourMap, pixel: float, file: Path) -> None:
    """Draw a map in a colour scale."""
    figure, axes = _one_plane()
    picture, span = _coloured(axes, how.scale * plane, how, pixel)
    axes.set(xlabel="x / mm", ylabel="y / mm", title=f"{how.title}{span}")
    figure.colorbar(picture, ax=axes, label=how.unit)
    FigureCanvasAgg(figure).print_png(file)


def _coloured(axes: Axes, plane: F4, how: ColourMap, pixel: float) -> tuple[AxesImage, str]:
    """Draw a map in colours; return its full range in words.

    The colours leave out one pixel in a thousand on either side if those pixels span a larger range
    than all others; otherwise a single bad corner would leave one colour for the rest.
    """
    values = plane[np.isfinite(plane) & (plane > 0 if how.logarithmic else True)]
    if not values.size:
        values = np.ones(1, np.float32)
    low, high = float(values.min()), float(values.max())
    inner = [float(level) for level in np.percentile(values, [OUTER_PERCENT, 100 - OUTER_PERCENT])]
    wide = high - low > 2 * (inner[1] - inner[0]) and inner[1] > inner[0]
    least, most = inner if wide else (low, high)
    is_log = how.logarithmic and low < high
    scale = LogNorm(least, most) if is_log else Normalize(least, most)
    picture = axes.imshow(plane, cmap=how.colours, extent=_extent(plane, pixel), norm=scale)
    return picture, f", {low:.3g} to {high:.3g} {how.unit}"


def _extent(plane: F4, pixel: float) -> tuple[float, float, float, float]:
    """The image's borders in mm from its middle: left, right, bottom, top; y runs down."""
    half = plane.shape[1] * pixel / 2, plane.shape[0] * pixel / 2
    return -half[0], half[0], half[1], -half[1]


def draw_regions(regions: Contacts, grey: F4, title: str, file: Path) -> None:
    """Draw regions over the mean image, each in a colour and with its number."""
    plate = _plate(regions.shape, 0)
    colours = len(BIT_COLOURS)
    numbers, areas = np.unique(regions[regions > 0], return_counts=True)
    share = areas.sum() / regions.size
    plate.begin(grey)
    plate.colour(np.ma.masked_where(regions == 0, (regions - 1.0) % colours + 1))
    for number in numbers:
        # The region's pixel nearest to the centroid, which may lie outside, as for a ring.
        rows, columns = np.nonzero(regions == number)
        nearest = np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2)
        plate.number(int(number), float(columns[nearest]), float(rows[nearest]))
    plate.write(f"{title}: {len(numbers)}, on {share:.1%} of the pixels", file)


def draw_labels(bits: Labels, grey: F4, count: int, title: str, file: Path) -> None:
    """Draw a colour for each LED whose bit is set, and a dark one for several LEDs."""
    numbers = label_numbers(bits, count).astype(np.float32)
    plate = _plate(bits.shape, count)
    plate.begin(grey)
    plate.colour(np.ma.masked_equal(numbers, 0))
    plate.write(f"{title}: {(numbers > 0).mean():.1%} of the pixels", file)


class _Plate:
    """The mean image under numbers in colours: LEDs with a legend, or regions if `leds` is 0.

    Axes and legend are drawn once for all touches of a run, since they take ten times as long as
    the rest.
    """

    def __init__(self, shape: tuple[int, ...], leds: int) -> None:
        figure, self._axes = _one_plane()
        empty = np.zeros(shape)
        chosen = [*BIT_COLOURS[:leds], SEVERAL_COLOUR] if leds else BIT_COLOURS
        colours = ListedColormap(chosen)
        norm = BoundaryNorm(np.arange(0.5, len(chosen) + 1), colours.N)
        self._grey = self._axes.imshow(empty, cmap="gray", vmin=0, animated=True)
        self._over = self._axes.imshow(empty, cmap=colours, norm=norm, alpha=0.75, animated=True)
        self._axes.set(xlabel="x / px", ylabel="y / px")
        self._title = self._axes.set_title("", animated=True)
        if leds:
            bar = figure.colorbar(self._over, ax=self._axes, ticks=np.arange(1, leds + 2))
            bar.ax.set_yticklabels([*(f"LED {k + 1}" for k in range(leds)), "several"])
        self._canvas = FigureCanvasAgg(figure)
        self._canvas.draw()
        self._frame = self._canvas.copy_from_bbox(figure.bbox)

    def begin(self, grey: F4) -> None:
        """Draw the mean of a touch's images."""
        self._canvas.restore_region(self._frame)
        self._grey.set(data=grey, clim=(0, float(grey.max())))
        self._axes.draw_artist(self._grey)

    def colour(self, numbers: np.ma.MaskedArray[tuple[int, ...], np.dtype[np.floating]]) -> None:
        """Draw the colours of numbers from 1, except where they are masked."""
        self._over.set_data(numbers)
        self._axes.draw_artist(self._over)

    def number(self, number: int, x: float, y: float) -> None:
        """Write a number at a pixel."""
        written = self._axes.annotate(
            str(number), (x, y), ha="center", va="center", weight="bold",
            bbox={"boxstyle": "circle", "facecolor": "white", "edgecolor": "none"},
        )  # fmt: skip
        self._axes.draw_artist(written)
        written.remove()

    def write(self, title: str, file: Path) -> None:
        """Draw the axes and a title on top, and write the picture."""
        self._title.set_text(title)
        for artist in (*self._axes.spines.values(), self._title):
            self._axes.draw_artist(artist)
        picture = np.asarray(self._canvas.buffer_rgba())[..., 2::-1]
        ImageFile(file).write(picture)


_mine = threading.local()
"""The plates and last pictures of a thread; a Matplotlib figure belongs to one thread."""
MAX_PLATES = 8
"""Largest number of plates that a thread keeps, some 3 MB each."""


def _plate(shape: tuple[int, ...], leds: int) -> _Plate:
    plates: dict[object, _Plate] = _mine.__dict__.setdefault("plates", {})
    if (shape, leds) not in plates:
        if len(plates) == MAX_PLATES:
            plates.clear()
        plates[shape, leds] = _Plate(shape, leds)
    return plates[shape, leds]


def _one_plane() -> tuple[Figure, Axes]:
    figure = Figure(figsize=(6.4, 4.6), dpi=DPI)
    figure.subplots_adjust(left=0.1, right=0.97, bottom=0.12, top=0.92)
    return figure, figure.subplots()
