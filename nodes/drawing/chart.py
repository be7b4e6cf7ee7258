"""Pages with axes, drawn by OpenCV and Pillow: to load Matplotlib takes longer than a touch.

A page is cut into equal cells, each for one set of axes.  Places within axes are in their own
units; what lies beyond their borders is cut off.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageColor, ImageDraw, ImageFont, PngImagePlugin

Picture = NDArray[np.uint8]
"""H x W x 3, red, green, blue."""
Limits = tuple[float, float]
"""The values at an axis's left and right, or lower and upper, end."""
Names = Mapping[Any, str] | None
"""Texts at values of an axis; None: numbers."""
Scale = Literal["gray", "viridis", "magma", "signed"]
ORANGE, BLUE, GREY = "#ffb000", "#3c8fe6", "#9a9a9a"
"""Colours of plots that people with any sight tell apart."""
GRID_COLOUR, LIMIT_COLOUR = "#e4e4e4", "#d1495b"
DRAWN_BY = "Tactograph"
"""A picture's text chunk ``Software``."""
TEXT_PX, TITLE_PX = 13, 15
MARGINS_PX = (64, 36, 24, 50)
"""Space for text around axes: left, top, right, bottom."""
BAR_PX, BAR_GAP_PX, BAR_TEXT_PX = 16, 12, 74
"""Width of a colour bar, of the space before it and of its text."""
TICK_PX, TICK_SPACE_PX = 4, (75, 45)
"""Length of a tick, and the least space between two, across and down."""
SUBPIXEL_BITS = 4
"""OpenCV draws in sixteenths of a pixel."""
MAX_PLACE_PX = 1e4
"""Places further away would overflow OpenCV's integers."""
MIN_BLOCK_PX = 3.0
"""Pixels of an image that are enlarged to this size are drawn as blocks."""


class Page:
    """A white page of equal cells, under a title."""

    def __init__(
        self, width: int, height: int, rows: int = 1, columns: int = 1, title: str = ""
    ) -> None:
        self.pixels: Picture = np.full((height, width, 3), 255, np.uint8)
        self._texts: list[tuple[float, float, str, dict[str, Any]]] = []
        self._cells = rows, columns
        self._top = round(1.3 * TEXT_PX * (title.count("\n") + 1)) if title else 0
        self.write(title, width / 2, 6, anchor="ma", align="center")

    def write(self, text: str, x: float, y: float, **look: Any) -> None:
        """Write over all that is drawn; `look` as `PIL.ImageDraw.ImageDraw.text` takes it.

        Further looks are ``size`` in px and ``upright``.
        """
        self._texts.append((x, y, text, {"anchor": "mm", "fill": "black", **look}))

    def axes(
        self,
        row: int,
        column: int,
        x: Limits,
        y: Limits,
        title: str = "",
        labels: tuple[str, str] = ("", ""),
        *,
        names: tuple[Names, Names] = (None, None),
        columns: int = 0,
        square: bool = False,
        bar: bool = False,
        grid: bool = False,
    ) -> Axes:
        """Draw empty axes into a cell.

        Parameters
        ----------
        row, column
            The cell.
        x, y
            The values at the ends.
        title, labels
            The texts above, beneath and on the left.
        names
            Texts at values of x and y in place of numbers; an empty mapping leaves the axis bare.
        columns
            Cells of this row, if not as many as of the others.
        square
            Whether a unit is as long in both directions.
        bar
            Leave space for a colour bar.
        grid
            Draw lines at the ticks.
        """
        left, top, right, bottom = MARGINS_PX
        right += (BAR_GAP_PX + BAR_PX + BAR_TEXT_PX) * bar
        rows, usual = self._cells
        height, width = self.pixels.shape[:2]
        cell = np.array([width / (columns or usual), (height - self._top) / rows])
        size = cell - [left + right, top + bottom]
        corner = cell * [column, row] + [left, self._top + top]
        if square:
            span = np.abs([x[1] - x[0], y[1] - y[0]])
            fitted = span * (size / span).min()
            corner, size = corner + (size - fitted) / 2, fitted
        axes = Axes(self, np.round(corner).astype(int), np.round(size).astype(int), x, y)
        axes.frame(names, grid=grid)
        (left, top), (across, down) = axes.corner, axes.size
        self.write(title, left + across / 2, top - 8, anchor="mb", size=TITLE_PX)
        self.write(labels[0], left + across / 2, top + down + 34)
        self.write(labels[1], left - 50, top + down / 2, upright=True)
        return axes

    def save(self, file: Path) -> None:
        """Write the page as PNG."""
        page = Image.fromarray(self.pixels)
        pen = ImageDraw.Draw(page)
        for x, y, text, look in self._texts:
            look["font"] = font = _font(look.pop("size", TEXT_PX))
            if look.pop("upright", False):
                half = round(pen.textlength(text, font=font) / 2) + 1
                tile = Image.new("L", (2 * half, 2 * TEXT_PX))
                ImageDraw.Draw(tile).text((half, TEXT_PX), text, **{**look, "fill": 255})
                place = round(x) - TEXT_PX, round(y) - half
                page.paste(look["fill"], place, tile.rotate(90, expand=True))
            else:
                pen.text((x, y), text, **look)
        about = PngImagePlugin.PngInfo()
        about.add_text("Software", DRAWN_BY)
        page.save(file, "PNG", pnginfo=about, compress_level=1)


class Axes:
    """A part of a page with units of its own, whose upper left corner and size are in px."""

    def __init__(
        self, page: Page, corner: NDArray[np.int_], size: NDArray[np.int_], x: Limits, y: Limits
    ) -> None:
        self.corner, self.size = corner, size
        self.page, self._ends = page, (_apart(x), _apart(y))
        (left, top), (right, bottom) = corner, corner + size
        self._inside = page.pixels[top:bottom, left:right]
        self._scale: tuple[Picture, Limits] | None = None

    def frame(
        self,
        names: tuple[Names, Names] = (None, None),
        *,
        grid: bool = False,
        beside: Literal["left", "right"] = "left",
    ) -> None:
        """Draw the frame, and ticks with their numbers beneath and beside it."""
        page, (left, top), (right, bottom) = self.page, self.corner, self.corner + self.size
        texts = [
            tick_texts(ends, int(side) // space) if given is None else given
            for ends, side, space, given in zip(
                self._ends, self.size, TICK_SPACE_PX, names, strict=True
            )
        ]
        for value, text in texts[0].items():
            x = left + round(float(self.places(value, 0)[0]))
            if grid:
                _draw_line(page.pixels, (x, top), (x, bottom), GRID_COLOUR)
            _draw_line(page.pixels, (x, bottom), (x, bottom + TICK_PX), "black")
            page.write(text, x, bottom + TICK_PX + 3, anchor="ma")
        edge, out, anchor = (left, -1, "rm") if beside == "left" else (right, 1, "lm")
        for value, text in texts[1].items():
            y = top + round(float(self.places(0, value)[1]))
            if grid:
                _draw_line(page.pixels, (left, y), (right, y), GRID_COLOUR)
            _draw_line(page.pixels, (edge, y), (edge + out * TICK_PX, y), "black")
            page.write(text, edge + out * (TICK_PX + 3), y, anchor=anchor)
        cv2.rectangle(page.pixels, (left - 1, top - 1), (right, bottom), (0, 0, 0))

    def image(
        self,
        values: ArrayLike,
        colours: Scale | Sequence[str] = "gray",
        ends: Limits | None = None,
        *,
        opacity: float = 1.0,
    ) -> None:
        """Fill the axes with an image; what is not finite, or masked, shows what is beneath.

        `ends` are the values of the first and the last colour, by default the extremes.
        """
        plane = np.ma.filled(np.ma.asarray(values, np.float32), np.nan)
        known = np.isfinite(plane)
        found = plane[known] if known.any() else np.zeros(1)
        low, high = _apart(ends or (float(found.min()), float(found.max())))
        table = colour_table(colours)
        self._scale = table, (low, high)
        share = np.where(known, (plane - low) / (high - low), 0)
        picture = table[np.clip(share * len(table), 0, len(table) - 1).astype(np.uint8)]
        cover = self._fitted(known * np.float32(opacity))[..., None]
        self._inside[:] = np.rint(self._fitted(picture) * cover + self._inside * (1 - cover))

    def _fitted(self, image: NDArray[Any]) -> NDArray[Any]:
        width, height = (int(side) for side in self.size)
        enlarged = width / image.shape[1]
        how = cv2.INTER_AREA if enlarged < 1 else cv2.INTER_LINEAR
        how = cv2.INTER_NEAREST if enlarged >= MIN_BLOCK_PX else how
        return np.asarray(cv2.resize(image, (width, height), interpolation=how))

    def colour_bar(self, label: str = "", names: Names = None) -> None:
        """Draw the colours of the last image beside it; `names` are texts at values."""
        assert self._scale is not None
        table, ends = self._scale
        corner = self.corner + np.array([self.size[0] + BAR_GAP_PX, 0])
        bar = Axes(self.page, corner, np.array([BAR_PX, self.size[1]]), (0, 1), ends)
        bar._inside[:] = table[np.arange(self.size[1])[::-1] * len(table) // self.size[1], None]
        bar.frame(({}, names), beside="right")
        right = corner[0] + BAR_PX + BAR_TEXT_PX - TEXT_PX
        self.page.write(label, right, corner[1] + self.size[1] / 2, upright=True)

    def line(self, x: ArrayLike, y: ArrayLike, colour: str = BLUE, width: int = 1) -> None:
        """Draw a line through places, which breaks where one is not finite."""
        how = ImageColor.getrgb(colour), width, cv2.LINE_AA, SUBPIXEL_BITS
        for run in _runs(x, y):
            cv2.polylines(self._inside, [self._subpixels(*run)], False, *how)

    def area(
        self, x: ArrayLike, low: ArrayLike, high: ArrayLike, colour: str = BLUE, opacity: float = 1
    ) -> None:
        """Fill the area between two lines, which breaks where a place is not finite."""
        filled = self._inside.copy()
        for across, lower, upper in _runs(x, low, high):
            corners = np.append(across, across[::-1]), np.append(lower, upper[::-1])
            outline = self._subpixels(*corners)
            cv2.fillPoly(filled, [outline], ImageColor.getrgb(colour), cv2.LINE_AA, SUBPIXEL_BITS)
        cv2.addWeighted(filled, opacity, self._inside, 1 - opacity, 0, dst=self._inside)

    def circles(self, x: ArrayLike, y: ArrayLike, radius: ArrayLike, colour: str = ORANGE) -> None:
        """Draw circles whose radii are in the axes' units."""
        turn = np.linspace(0, 2 * np.pi, 65)
        for across, down, r in zip(*map(np.ravel, (x, y, radius)), strict=True):
            self.line(across + r * np.cos(turn), down + r * np.sin(turn), colour)

    def dots(self, x: ArrayLike, y: ArrayLike, colour: str, size_px: float = 2.0) -> None:
        """Draw dots."""
        how = ImageColor.getrgb(colour), -1, cv2.LINE_AA, SUBPIXEL_BITS
        for place in self._subpixels(np.ravel(x), np.ravel(y)).tolist():
            cv2.circle(self._inside, place, round(size_px * (1 << SUBPIXEL_BITS)), *how)

    def arrows(
        self, x: ArrayLike, y: ArrayLike, by_x: ArrayLike, by_y: ArrayLike, colour: str = BLUE
    ) -> None:
        """Draw arrows from places on, in the axes' units, where they are finite."""
        how = ImageColor.getrgb(colour), 1, cv2.LINE_AA, SUBPIXEL_BITS, 0.15
        for run in _runs(x, y, by_x, by_y):
            begin, end = self._subpixels(*run[:2]), self._subpixels(*run[:2] + run[2:])
            for one, other in zip(begin.tolist(), end.tolist(), strict=True):
                cv2.arrowedLine(self._inside, one, other, *how)

    def write(self, text: str, x: float, y: float, **look: Any) -> None:
        """Write at a place; see `Page.write`."""
        self.page.write(text, *(self.places(x, y) + self.corner), **look)

    def places(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """Places in px from the upper left corner, N x 2 for N places."""
        (left, right), (lower, upper) = self._ends
        across = (np.asarray(x, np.float64) - left) / (right - left)
        down = (upper - np.asarray(y, np.float64)) / (upper - lower)
        return np.stack(np.broadcast_arrays(across, down), axis=-1) * self.size

    def _subpixels(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.int32]:
        near = np.clip(self.places(x, y) - 0.5, -MAX_PLACE_PX, MAX_PLACE_PX)
        return np.round(near * (1 << SUBPIXEL_BITS)).astype(np.int32)


@cache
def scale_table(name: Scale) -> Picture:
    """256 x 3, the colours of a scale from its low end on."""
    ramp = np.arange(256, dtype=np.uint8)
    if name == "gray":
        return np.stack([ramp] * 3, axis=-1)
    if name == "signed":
        ends = np.array([ImageColor.getrgb(colour) for colour in ("#2166ac", "#f7f7f7", "#b2182b")])
        return np.stack([np.interp(ramp, [0, 127.5, 255], end) for end in ends.T], -1).astype("u1")
    known = {"viridis": cv2.COLORMAP_VIRIDIS, "magma": cv2.COLORMAP_MAGMA}
    return np.asarray(cv2.applyColorMap(ramp[:, None], known[name])[:, 0, ::-1], np.uint8)


def colour_table(colours: Scale | Sequence[str]) -> Picture:
    """N x 3, the colours of a scale, or those that are named one by one."""
    if isinstance(colours, str):
        return scale_table(colours)
    return np.array([ImageColor.getrgb(colour) for colour in colours], np.uint8)


def pixel_ends(image: NDArray[Any], side_px: int = 1) -> tuple[Limits, Limits]:
    """Left and right, bottom and top of an image whose pixels have this side."""
    rows, columns = image.shape
    return (-0.5, columns * side_px - 0.5), (rows * side_px - 0.5, -0.5)


def round_up(value: float) -> float:
    """Round up to 1, 2, 5 or 10 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(max(value, 1e-9)))
    return next(step * power for step in (1, 2, 5, 10) if step * power >= value * (1 - 1e-9))


def tick_texts(ends: Limits, most: int) -> dict[float, str]:
    """Round values between two ends, `most` or one more, and how they are written."""
    low, high = sorted(ends)
    step = round_up((high - low) / max(most, 2))
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    numbers = range(math.ceil(low / step - 1e-6), math.floor(high / step + 1e-6) + 1)
    return {number * step: f"{number * step:.{digits}f}" for number in numbers}


@cache
def _font(size: int) -> Any:
    return ImageFont.load_default(size)


def _apart(ends: Limits) -> Limits:
    return ends if ends[0] != ends[1] else (ends[0] - 0.5, ends[1] + 0.5)


def _draw_line(pixels: Picture, begin: tuple[int, int], end: tuple[int, int], colour: str) -> None:
    cv2.line(pixels, [*map(int, begin)], [*map(int, end)], ImageColor.getrgb(colour))


def _runs(*rows: ArrayLike) -> list[NDArray[Any]]:
    """Rows of one length, cut where a value in any of them is not finite."""
    values = np.array(np.broadcast_arrays(*map(np.ravel, rows)), np.float64)
    known = np.isfinite(values).all(axis=0)
    cuts = np.flatnonzero(np.diff(known)) + 1
    parts = zip(np.split(values, cuts, axis=1), np.split(known, cuts), strict=True)
    return [part for part, there in parts if there.size and there[0]]
