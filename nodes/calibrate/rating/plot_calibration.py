"""Plot a calibration, so that a person can tell a good one from a bad one.

Long because it draws up to six pictures on one page.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.graph import Port, node
from tactograph.nodes import (
    F4,
    U1,
    Light,
    Mask,
    Metrics,
    NullVector,
    Reflectance,
    Spread,
)
from tactograph.nodes.calibrate import BallCircles, BallPress
from tactograph.nodes.calibrate.tables.build_lut import in_tables
from tactograph.nodes.drawing.chart import BLUE, GREY, LIMIT_COLOUR, ORANGE, Axes, Page, pixel_ends
from tactograph.nodes.drawing.new_picture import BesidePicture, in_lines, write_picture
from tactograph.nodes.optics.reflectance_map import harmonics
from tactograph.nodes.optics.sheet import SheetLabels, SheetLight, SheetMask, SheetSlope, cut

PAGE_SIZE_PX, WIDE_PAGE_PX = (1100, 830), 1600
"""Width and height of the page of one press, and the width of that of several."""
SLOPE_BINS, DEPARTURE_BINS, MAX_DEPARTURE = 60, 100, 10.0
PX_LABELS, SLOPE_LABELS = ("x / px", "y / px"), ("p = dz/dx / mm per mm", "q = dz/dy / mm per mm")
MAX_NAMES = 20
"""Most balls that are labelled with the names of their presses."""
MAX_NAME_LETTERS = 24
"""Most letters of a press's name."""


class Binned(NamedTuple):
    """The film at rest, whose size is that of a press, and the binning of the camera's pixels."""

    flat: Light
    factor: int


class NullTest(NamedTuple):
    """The null vector, and the standard deviation of a.I on lit pixels."""

    null: NullVector
    spread: Spread


class NamedBalls(NamedTuple):
    """Circle and press of every ball, and the presses' names."""

    circle: BallCircles
    of: BallPress
    names: list[str]


class HeldOutErrors(NamedTuple):
    """Errors by press of slope and height; NaN where there are none."""

    degrees: Annotated[F4, Port("P", "deg", nan=True)]
    microns: Annotated[F4, Port("P", "um", nan=True)]


_FORMER_INPUTS = {
    **dict.fromkeys(("flat", "pixel", "camera_pixel"), "give 'bin_presses' as 'frames'"),
    "lut_slope": "it follows from 'slope', 'mask' and 'lit'",
    "spread": "give 'fit_null_vector' as 'null'",
    **dict.fromkeys(("names", "circle", "of"), "give 'find_balls' as 'balls'"),
    **dict.fromkeys(("degrees", "microns"), "give 'hold_out_presses' as 'held_out'"),
}


@node(former=_FORMER_INPUTS)
def plot_calibration(
    light: SheetLight,
    frames: Binned,
    mask: SheetMask,
    slope: SheetSlope,
    lit: SheetLabels,
    reflectance: Reflectance,
    null: NullTest,
    quality: Metrics,
    balls: NamedBalls | None = None,
    held_out: HeldOutErrors | None = None,
    advice: str | None = None,
    area: Mask | None = None,
    *,
    file: BesidePicture,
) -> None:
    """Draw the objects found, the tables' coverage, the fit's residual and the null test.

    For several presses, also draw where they lie on the film, which are left out, and each
    press's error with a calibration by the others.

    Parameters
    ----------
    light, mask, slope, lit
        Of the calibration object, or of all presses on a sheet; the mask of those used.
    frames
        `bin_presses`: the size of a press, and the camera's pixels, which the axes count, to one
        of these.
    reflectance, null
        The fits: that of `fit_reflectance`, and `fit_null_vector`.
    quality
        The figures of the calibration, for the title.
    balls, held_out, advice
        Of several presses: `find_balls`, `hold_out_presses`, and what to press next.
    area
        H x W of the frames, 1 where they show film; a blue line is its edge.
    file
        The picture goes beside it: ``cal.npz`` gives ``cal.png``.
    """
    rows, wide = frames.flat.shape[1], frames.factor
    lights, masks = cut(light, rows), cut(mask, rows)
    title = _title(quality) + (f"\n{advice}" if advice else "")
    several = len(lights) > 1
    width, height = PAGE_SIZE_PX
    page = Page(WIDE_PAGE_PX if several else width, height, 2, 3 if several else 2, title)
    x, y = pixel_ends(masks[0], wide)
    in_px = partial(page.axes, x=x, y=y, labels=PX_LABELS, square=True)
    residuals = [
        _residual(*press, reflectance)
        for press in zip(lights, masks, cut(slope, rows), cut(lit, rows), strict=True)
    ]
    _draw_residual(
        in_px(1, 0, title="misfit of the reflectance |I - R|, the largest of all LEDs", bar=True),
        np.fmax.reduce(residuals),
    )
    _draw_coverage(page, slope[:, in_tables(mask, lit, len(light))])
    _draw_null(page, light, mask, lit, *null)
    film = "" if area is None or area.all() else f"; film within the blue line: {area.mean():.0%}"
    if not several:
        found = in_px(0, 0, title=f"mean light, and the pixels of known slope{film}")
        found.image(light.mean(axis=0))
        _draw_edge(found, mask, wide, ORANGE)
    else:
        used = np.array([part.any() for part in masks])
        out = int((~used).sum())
        words = f"presses on the film: {int(used.sum())} used, {out} left out{film}"
        found = in_px(0, 0, title=words)
        found.image(-np.sum([part > 0 for part in masks], axis=0), ends=(-6, 0))
        if balls is not None and balls.names:
            _draw_presses(found, balls, used, wide)
            if held_out is not None:
                degrees, microns = held_out
                _draw_errors(page, 0, balls.names, degrees, used, "normal, held out / degrees")
                _draw_errors(page, 1, balls.names, microns, used, "height, held out / um")
    if film and area is not None:
        _draw_edge(found, area, wide, BLUE)
    write_picture(page, file.with_suffix(".png"))


def _title(quality: Metrics) -> str:
    """The figures that do not concern a single LED, a few per line."""
    figures = [
        f"{name} {int(value) if float(value).is_integer() else format(value, '.4g')}"
        for name, value in quality.items()
        if "/" not in name
    ]
    return in_lines(figures)


def _draw_edge(axes: Axes, mask: U1, wide: int, colour: str) -> None:
    """Draw the edge of a mask, beyond which nothing is fitted."""
    edges, _ = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    for edge in edges:
        closed = np.concatenate([edge, edge[:1]])[:, 0]
        x, y = wide * closed.T + (wide - 1) / 2
        axes.line(x, y, colour)


def _draw_coverage(page: Page, slope: F4) -> None:
    p, q = slope.astype(np.float64)
    ends = (p.min(), p.max()), (q.min(), q.max())
    counts, *_ = np.histogram2d(p, q, SLOPE_BINS, ends)
    title = f"slopes in the tables ({slope.shape[1]} pixels)"
    axes = page.axes(0, 1, *ends, title, SLOPE_LABELS, square=True, bar=True)
    powers = np.log10(np.where(counts > 0, counts, np.nan))
    axes.image(powers.T[::-1], "viridis")
    axes.colour_bar("pixels in a cell", {k: f"{10**k}" for k in range(int(np.nanmax(powers)) + 1)})


def _draw_presses(axes: Axes, balls: NamedBalls, used: NDArray[np.bool_], wide: int) -> None:
    """Draw the circles of all contacts; those left out are grey."""
    # The middle of the first pixel is at (wide - 1) / 2 of the camera's.
    middle = (wide - 1) / 2
    placed = balls.circle * np.float32(wide) + np.array([middle, middle, 0], np.float32)
    for press, (x, y, radius) in zip(balls.of, placed, strict=True):
        if radius == 0:
            continue
        axes.circles(x, y, radius, ORANGE if used[press] else GREY)
        if len(placed) <= MAX_NAMES:
            name = balls.names[press][:MAX_NAME_LETTERS]
            axes.write(name, float(x), float(y - radius), size=10, anchor="md")


def _draw_errors(
    page: Page, row: int, names: list[str], errors: F4, used: NDArray[np.bool_], label: str
) -> None:
    """Draw a bar for each press; a press that is left out has none."""
    most = float(np.nanmax(errors, initial=0)) or 1.0
    axes = page.axes(
        row, 2, (0, 1.05 * most), (len(names) - 0.5, -0.5), f"error by press: {label}",
        (label.rpartition(" / ")[2], ""), names=(None, {}),
    )  # fmt: skip
    for place, (name, error, good) in enumerate(zip(names, errors, used, strict=True)):
        if np.isfinite(error):
            axes.area([0, error], place - 0.25, place + 0.25)
        if len(names) <= MAX_NAMES:
            text = name[:MAX_NAME_LETTERS] + ("" if good else " (out)")
            axes.write(f" {text}", 0, place, size=10, anchor="lm")


def _residual(light: F4, mask: U1, slope: F4, lit: U1, reflectance: F4) -> F4:
    """Largest departure from the fit of the LEDs that reach a pixel; NaN where unknown."""
    model = np.tensordot(reflectance, harmonics(slope), axes=1)
    error = np.zeros(mask.shape, np.float32)
    for k, plane in enumerate(light):
        used = (mask > 0) & ((lit >> k) & 1 > 0)
        error = np.maximum(error, np.where(used, np.abs(plane - model[k]), 0))
    return np.where(mask > 0, error, np.float32(np.nan))


def _draw_residual(axes: Axes, error: F4) -> None:
    # Single pixels at the rim, which are partly in shadow, must not hide the rest.
    axes.image(100 * error, "magma", (0, 100 * float(np.nanpercentile(error, 99))))
    axes.colour_bar("% of the light of the film at rest")


def _draw_null(page: Page, light: F4, mask: U1, lit: U1, null: NullVector, spread: Spread) -> None:
    title = "linear dependence of the light where all LEDs reach"
    labels, ends = ("a.I / its standard deviation", "pixels"), (-MAX_DEPARTURE, MAX_DEPARTURE)
    if spread == 0:
        bare = page.axes(1, 1, (0, 1), (0, 1), names=({}, {}))
        bare.write("three LEDs:\nno shadow test", 0.5, 0.5, align="center")
        return
    chosen = (mask > 0) & (lit == (1 << len(light)) - 1)
    departure = np.clip(np.tensordot(null, light, axes=1)[chosen] / spread, *ends)
    counts, edges = np.histogram(departure, DEPARTURE_BINS, ends)
    axes = page.axes(1, 1, ends, (0, 1.05 * float(counts.max(initial=1))), title, labels)
    axes.area(np.repeat(edges, 2)[1:-1], 0, np.repeat(counts, 2))
    for threshold in (-3, 3):
        axes.line([threshold, threshold], [0, 1.05 * float(counts.max(initial=1))], LIMIT_COLOUR)
