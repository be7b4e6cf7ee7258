"""Write a touch: arrays for programs, pictures for people, and where it all comes from."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

from tactograph.graph import Provenance, node, warn
from tactograph.graph.files.whole_files import whole_files
from tactograph.nodes import (
    F4,
    Confidence,
    Height,
    HeightError,
    Labels,
    Lens,
    Light,
    Metrics,
    PixelSize,
    Vergence,
)
from tactograph.nodes.calibrate._led_colours import LED_COLOURS
from tactograph.nodes.write._film_places import on_even_grid
from tactograph.nodes.write._height_files import write_mesh, write_tiff

FEWEST = 3
"""With so many LEDs a shadow leaves two, and two lights allow two slopes."""
BAND = 1.645
"""Half of the 90 % band, in standard deviations."""


@node
def write_result(
    height: Height,
    shadow: Labels,
    image: Light,
    pixel: PixelSize,
    metrics: Metrics,
    name: str,
    error: HeightError | None = None,
    highlight: Labels | None = None,
    confidence: Confidence | None = None,
    lens: Lens | None = None,
    camera: Vergence | None = None,
    *,
    folder: Path,
    grid: Literal["pixel", "metric"] = "pixel",
    mesh: bool = True,
    pictures: bool = True,
    provenance: Provenance,
) -> None:
    """Write the result of one touch into `folder`, or a folder of its name inside.

    ``height.npy`` and ``height.tiff`` (float32, mm), ``height.ply`` (a mesh in mm, x right,
    y up, z to the camera), ``shadow.png`` (bit k-1 set where LED k does not light the
    pixel), ``height.png`` and ``shadow_view.png`` for people, ``result.json``; with an error
    ``error.npy`` and ``error.png`` too, with highlights ``highlight.png`` (bits as in
    ``shadow.png``), with a confidence ``confidence.npy`` (float32, 0 to 1) and
    ``confidence.png``.

    Parameters
    ----------
    height
        H x W in mm.
    shadow
        H x W, the shadowed LEDs.
    image
        K x H x W, what was captured; the background of ``shadow_view.png``.
    pixel
        mm per px.
    metrics
        Figures to keep in ``result.json``.
    name
        The capture's name in a stream; empty for a single capture.
    error
        H x W, the height's standard deviation in mm, where the graph knows it.
    highlight
        H x W, the LEDs that the film mirrors, where the graph looks for them.
    confidence
        H x W, the probability that the shadow labels are right, where the graph knows it.
    lens, camera
        Length 8, as `read_lens` gives it, and 1 / D in 1/mm, with D the height of the camera's
        pupil above the film (0: orthographic), where the graph knows them.  The mesh has its
        points where these lie on the film.
    folder
        Made if needed.
    grid
        "pixel": ``height.npy`` is what each pixel of the camera sees.  "metric": height and
        error are on an even grid on the film, `pixel` apart, of the image's size and about its
        middle; NaN at the border where no pixel sees the film.  Labels and confidence stay
        those of the pixels.
    mesh, pictures
        Whether to write those too; they take longer than all the rest.

    Raises
    ------
    InputError
        If the folder cannot be written, or the film rises to the camera; then no file of this
        touch is.
    """
    if len(image) == FEWEST and shadow.any():
        share = np.mean(shadow != 0)
        warn(
            f"three LEDs, {share:.1%} of the pixels in shadow: two lights allow two slopes, so "
            "heights there and beyond may be wrong; a fourth LED, or 'precise', helps"
        )
    placed, vergence = lens, camera or 0.0
    if grid == "metric":
        height, known = on_even_grid(height, [] if error is None else [error], lens, vergence)
        error = known[0] if known else None
        placed, vergence = None, 0.0
    with whole_files(folder / name if name else folder) as target:
        np.save(target / "height.npy", height)
        write_tiff(target / "height.tiff", height, pixel)
        cv2.imwrite(str(target / "shadow.png"), shadow)
        if error is not None:
            np.save(target / "error.npy", error)
        if highlight is not None:
            cv2.imwrite(str(target / "highlight.png"), highlight)
        if confidence is not None:
            np.save(target / "confidence.npy", confidence)
        if mesh:
            write_mesh(target / "height.ply", height, pixel, placed, vergence)
        if pictures:
            _draw_height(height, error, pixel, target / "height.png")
            if error is not None:
                _draw_error(error, pixel, target / "error.png")
            if confidence is not None:
                _draw_confidence(confidence, pixel, target / "confidence.png")
            _draw_shadow(shadow, image, target / "shadow_view.png")
        text = json.dumps(
            {**provenance.as_dict(), "capture": name, "grid": grid, "metrics": metrics}, indent=1
        )
        (target / "result.json").write_text(text + "\n")


def _draw_height(height: Height, error: HeightError | None, pixel: float, file: Path) -> None:
    """The height map in mm, and the cross-section through its highest point with its error."""
    rows, columns = height.shape
    top = int(np.unravel_index(int(np.nanargmax(height)), height.shape)[0])
    figure = Figure(figsize=(10, 4), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, width_ratios=(1.25, 1))
    extent = (0, columns * pixel, rows * pixel, 0)
    picture = left.imshow(height, cmap="viridis", extent=extent)
    left.axhline((top + 0.5) * pixel, color="white", linewidth=0.7, linestyle="--")
    left.set(xlabel="x / mm", ylabel="y / mm", title="height above the film at rest")
    figure.colorbar(picture, ax=left, label="mm")
    across = (np.arange(columns) + 0.5) * pixel
    right.plot(across, height[top], linewidth=1)
    if error is not None:
        half = BAND * error[top]
        right.fill_between(across, height[top] - half, height[top] + half, alpha=0.35, label="90 %")
        right.legend(loc="upper right")
    right.set(xlabel="x / mm", ylabel="height / mm", title=f"section at y = {top * pixel:.2f} mm")
    right.grid(alpha=0.3)
    figure.savefig(file, dpi=110)


def _draw_error(error: HeightError, pixel: float, file: Path) -> None:
    """The height's standard deviation in micrometres."""
    _draw_plane(1e3 * error, pixel, "standard deviation of the height", "µm", "magma", file)


def _draw_confidence(confidence: Confidence, pixel: float, file: Path) -> None:
    """The probability that the shadow labels are right."""
    _draw_plane(confidence, pixel, "shadow labels: probability of all", "", "gray", file)


def _draw_plane(plane: F4, pixel: float, title: str, unit: str, colours: str, file: Path) -> None:
    rows, columns = plane.shape
    figure = Figure(figsize=(6.4, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    extent = (0, columns * pixel, rows * pixel, 0)
    picture = axes.imshow(plane, cmap=colours, extent=extent)
    axes.set(xlabel="x / mm", ylabel="y / mm", title=title)
    figure.colorbar(picture, ax=axes, label=unit)
    figure.savefig(file, dpi=110)


def _draw_shadow(shadow: Labels, image: Light, file: Path) -> None:
    """The labels over the mean image: a colour per shadowed LED, white for several."""
    count = image.shape[0]
    numbers = _label_numbers(shadow, count)
    figure = Figure(figsize=(6.4, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.imshow(image.mean(axis=0), cmap="gray", vmin=0)
    colours = ListedColormap([*LED_COLOURS[:count], "#ffffff"])
    norm = BoundaryNorm(np.arange(0.5, count + 2), colours.N)
    drawn = axes.imshow(np.ma.masked_equal(numbers, 0), cmap=colours, norm=norm, alpha=0.75)
    bar = figure.colorbar(drawn, ax=axes, ticks=np.arange(1, count + 2))
    bar.ax.set_yticklabels([*(f"LED {k + 1}" for k in range(count)), "several"])
    axes.set(
        title=f"in shadow: {(numbers > 0).mean():.1%} of the pixels",
        xlabel="x / px",
        ylabel="y / px",
    )
    figure.savefig(file, dpi=110)


def _label_numbers(shadow: Labels, count: int) -> F4:
    """0 for lit, k where LED k alone is dark, count + 1 where several are."""
    bits = np.stack([(shadow >> k) & 1 for k in range(count)]).astype(np.int64)
    dark = bits.sum(axis=0)
    single = (bits * np.arange(1, count + 1)[:, None, None]).sum(axis=0)
    return np.where(dark > 1, count + 1, single).astype(np.float32)
