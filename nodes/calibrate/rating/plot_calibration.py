"""Plot a calibration, so that a person can judge it.

Long because it draws up to six pictures on one page.
"""

import textwrap
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from tactograph.graph import node
from tactograph.nodes import F4, U1, Light, Mask, Metrics, NullVector, Reflectance, Spread
from tactograph.nodes.calibrate.ball.find_balls import FoundBalls
from tactograph.nodes.calibrate.rating.hold_out_presses import HeldOut
from tactograph.nodes.calibrate.tables.build_lut import in_tables
from tactograph.nodes.calibrate.tables.fit_null_vector import NullFit
from tactograph.nodes.drawing.new_picture import FIGURES_IN, Colour, NewPicture
from tactograph.nodes.optics.gauss_newton import SlopeNormal
from tactograph.nodes.optics.sheet import SheetLabels, SheetLight, SheetMask, SheetSlope, cut

LETTERS_PER_IN = 10
"""Letters in an inch of the title."""
HEIGHT_IN, LINE_IN, AXES_TITLE_IN = 8, 0.2, 0.6
"""Heights in inches: of the page, a line of its title, and the title of axes with its margin."""
MAX_NAMES = 20
"""Largest number of balls that are labelled with the names of their presses."""
MAX_NAME_LETTERS = 24
"""Largest number of letters of a press's name."""


class Binned(NamedTuple):
    """The film at rest, at the size of a press, and the binning of the camera's pixels."""

    flat: Light
    factor: int


@node
def plot_calibration(
    light: SheetLight,
    frames: Binned,
    mask: SheetMask,
    slope: SheetSlope,
    lit: SheetLabels,
    reflectance: Reflectance,
    null: NullFit,
    quality: Metrics,
    balls: FoundBalls | None = None,
    held_out: HeldOut | None = None,
    advice: str | None = None,
    area: Mask | None = None,
    verdict: str | None = None,
    *,
    picture: NewPicture,
) -> None:
    """Draw the objects, the coverage of the tables, the residual of the fit and the null test.

    For several presses, also draw their places on the film, which ones are left out, and the error
    of each with a calibration by the others.

    Parameters
    ----------
    light, mask, slope, lit
        Of the calibration object, or of all presses on a sheet; the mask marks pixels in use.
    frames
        `bin_presses`: the size of a press, and the side of its pixels in camera pixels, which the
        axes count.
    reflectance, null : the fits: K x 9, that of `fit_reflectance`, and `fit_null_vector`
    quality : the figures of the calibration, for the title
    balls, held_out, advice
        Of several presses: `find_balls`, `hold_out_presses`, and what to press next.
    area : H x W of the frames, 1 where they show film; its edge is dotted
    verdict : of the calibration; it comes first
    file : the calibration; the picture is written beside it, ``cal.png`` for ``cal.npz``
    """
    rows, wide = frames.flat.shape[1], frames.factor
    lights, masks = cut(light, rows), cut(mask, rows)
    width = FIGURES_IN + (10 if len(lights) == 1 else 14)
    words = [verdict, advice and f"next: {advice}"]
    filled = [textwrap.fill(text, round(LETTERS_PER_IN * width)) for text in words if text]
    title = "\n".join(filled)
    figure = Figure(figsize=(width, HEIGHT_IN), dpi=100)
    # Fixed margins take half the time of a layout that measures every text.
    top = 1 - (LINE_IN * (title.count("\n") + 1) + AXES_TITLE_IN) / HEIGHT_IN
    right = 1 - (FIGURES_IN + 0.4) / width
    figure.subplots_adjust(left=0.05, right=right, bottom=0.07, top=top, wspace=0.5, hspace=0.35)
    axes = figure.subplots(2, 2 if len(lights) == 1 else 3)
    residuals = [
        _residual(*press, reflectance)
        for press in zip(lights, masks, cut(slope, rows), cut(lit, rows), strict=True)
    ]
    _draw_residual(figure, axes[1, 0], np.fmax.reduce(residuals), wide)
    _draw_coverage(figure, axes[0, 1], slope[:, in_tables(mask, lit, len(light))])
    _draw_null(axes[1, 1], light, mask, lit, *null)
    if len(lights) == 1:
        _draw_circle(axes[0, 0], light, mask, wide)
    elif balls is not None and balls.names:
        used = np.array([part.any() for part in masks])
        _draw_presses(axes[0, 0], masks, balls, used, wide)
        if held_out is not None:
            degrees, microns, _ = held_out
            _draw_errors(axes[0, 2], balls.names, degrees, used, "normal, held out / degrees")
            _draw_errors(axes[1, 2], balls.names, microns, used, "height, held out / um")
    if area is not None and not area.all():
        _draw_area(axes[0, 0], area, wide)
    figure.suptitle(title, x=0.02, ha="left", fontsize=11)
    # Those of single LEDs are printed.
    shown = {name: quality[name] for name in quality if "/" not in name}
    picture.write(figure, shown, top)


def _draw_circle(axes: Axes, light: F4, mask: U1, wide: int) -> None:
    extent = _extent(mask.shape, wide)
    axes.imshow(light.mean(axis=0), cmap="gray", extent=extent)
    axes.contour(
        mask, extent=extent, origin="upper", levels=[0.5], colors=[Colour.ORANGE], linewidths=1
    )
    axes.set(title="mean light, and the pixels of known slope", xlabel="x / px", ylabel="y / px")


def _draw_area(axes: Axes, area: U1, wide: int) -> None:
    """Draw the edge of the film, beyond which nothing is fitted."""
    look: dict[str, Any] = {"colors": [Colour.BLUE], "linewidths": 1.5, "linestyles": "dotted"}
    axes.contour(area, extent=_extent(area.shape, wide), origin="upper", levels=[0.5], **look)
    axes.set_title(f"{axes.get_title()}\nfilm within the dotted line: {area.mean():.0%}")


def _extent(shape: tuple[int, ...], wide: int) -> tuple[float, float, float, float]:
    """Left, right, bottom and top of an image whose pixels are `wide` pixels of the camera."""
    rows, columns = shape
    return -0.5, columns * wide - 0.5, rows * wide - 0.5, -0.5


def _draw_coverage(figure: Figure, axes: Axes, slope: F4) -> None:
    drawn = axes.hexbin(*slope, gridsize=60, bins="log", cmap="viridis")
    figure.colorbar(drawn, ax=axes, label="pixels in a cell")
    axes.set(aspect="equal", title=f"slopes in the tables ({slope.shape[1]} pixels)")
    axes.set(xlabel="p = dz/dx / mm per mm", ylabel="q = dz/dy / mm per mm")


def _draw_presses(
    axes: Axes, masks: list[U1], balls: FoundBalls, used: NDArray[np.bool_], wide: int
) -> None:
    """Draw the film with all contacts; contacts that are left out are grey and dashed."""
    depth = np.sum([mask > 0 for mask in masks], axis=0)
    scale = {"vmin": 0, "vmax": max(3, depth.max())}
    axes.imshow(depth, cmap="Blues", extent=_extent(depth.shape, wide), **scale)
    # The middle of the first pixel is at (wide - 1) / 2 in camera pixels.
    middle = (wide - 1) / 2
    placed = balls.circle * np.float32(wide) + np.array([middle, middle, 0], np.float32)
    for press, (x, y, radius) in zip(balls.of, placed, strict=True):
        if radius == 0:
            continue
        look = (
            {"color": Colour.ORANGE} if used[press] else {"color": Colour.GREY, "linestyle": "--"}
        )
        axes.add_patch(Circle((x, y), radius, fill=False, **look))
        if len(placed) <= MAX_NAMES:
            name = balls.names[press][:MAX_NAME_LETTERS]
            axes.text(x, y - radius, name, fontsize=7, ha="center", va="bottom")
    counted = f"{int(used.sum())} used, {int((~used).sum())} left out"
    axes.set(title=f"presses on the film: {counted}", xlabel="x / px", ylabel="y / px")


def _draw_errors(
    axes: Axes, names: list[str], errors: F4, used: NDArray[np.bool_], label: str
) -> None:
    """Draw a bar for each press; a press that is left out has none."""
    places = np.arange(len(names))
    axes.barh(places, np.nan_to_num(errors), height=0.5, color=Colour.BLUE)
    labels = [
        name[:MAX_NAME_LETTERS] + ("" if good else " (out)")
        for name, good in zip(names, used, strict=True)
    ]
    axes.set_yticks(places, labels, fontsize=7)
    axes.invert_yaxis()
    axes.set(title=f"error by press: {label}", xlabel=label.rpartition(" / ")[2])


def _residual(light: F4, mask: U1, slope: F4, lit: U1, reflectance: F4) -> F4:
    """Largest departure from the fit of the LEDs that reach a pixel; NaN where unknown."""
    model = np.tensordot(reflectance, SlopeNormal(*slope).harmonics, axes=1)
    error = np.zeros(mask.shape, np.float32)
    for k, plane in enumerate(light):
        used = (mask > 0) & ((lit >> k) & 1 > 0)
        error = np.maximum(error, np.where(used, np.abs(plane - model[k]), 0))
    return np.where(mask > 0, error, np.float32(np.nan))


def _draw_residual(figure: Figure, axes: Axes, error: F4, wide: int) -> None:
    # Single pixels at the rim, which are partly shadowed, must not dominate the scale.
    most = float(np.nanpercentile(error, 99))
    percent = np.ma.masked_invalid(100 * error)
    extent = _extent(error.shape, wide)
    drawn = axes.imshow(percent, cmap="magma", vmin=0, vmax=100 * most, extent=extent)
    figure.colorbar(drawn, ax=axes, label="% of the film at rest, largest of all LEDs")
    axes.set(title="misfit of the reflectance", xlabel="x / px", ylabel="y / px")


def _draw_null(axes: Axes, light: F4, mask: U1, lit: U1, null: NullVector, spread: Spread) -> None:
    if spread == 0:
        axes.text(0.5, 0.5, "three LEDs:\nno shadow test", ha="center", va="center")
        axes.set_axis_off()
        return
    chosen = (mask > 0) & (lit == (1 << len(light)) - 1)
    departure = np.tensordot(null, light, axes=1)[chosen] / spread
    # One outline is drawn several times as fast as a hundred bars.
    axes.stairs(*np.histogram(np.clip(departure, -10, 10), bins=100), fill=True, color=Colour.BLUE)
    for threshold in (-3, 3):
        axes.axvline(threshold, color="#d1495b", linewidth=1)
    axes.set(xlabel="a.I / its standard deviation; red: limits of the shadow test", ylabel="pixels")
    axes.set_title("linear dependence, where all LEDs reach")
