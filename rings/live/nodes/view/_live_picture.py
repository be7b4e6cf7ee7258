"""Draw a picture of a touch for a live stream, fast enough for every camera frame."""

import math
import os
import sys
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from tactograph.sdk import F4, Arrows, ColourMap, Height, InputError, LabelMap, Light, Lights, Touch

Picture = NDArray[np.uint8]
"""H x W x 3, red, green, blue."""
HEIGHT_PX = 480
"""Rows of the height's panel; the two beside it share them."""
GAP_PX = 12
BAR_PX = 20
BAR_TEXT_PX = 52
TITLE_PX = 26
TEXT_PX = 14
BACKGROUND_RGB = (24, 24, 28)
TEXT_RGB = (225, 225, 225)
UNKNOWN_RGB = (70, 70, 70)
LABEL_OPACITY = 0.75
DIMMED_SHARE = 0.6
"""Brightness of the image under the labels, so that their colours stand out."""
WHITE_SHARE = 0.995
"""Share of the pixels that are shown below white."""
MIN_TOP_MM = 0.1
"""Upper end of the colour scale of a flat film."""
LED_COLOURS = LabelMap("LEDs", leds=True).colours
"""Of each label of LEDs."""
LABEL_BITS = len(LED_COLOURS).bit_length() - 1
BLUE_CURVE, GREEN_CURVE, RED_CURVE = ("blue", "#3d7bff"), ("green", "#36c25b"), ("red", "#ff5247")
LIGHT_NAMES: dict[Lights, tuple[tuple[str, str], ...]] = {
    "leds": tuple((str(k + 1), LED_COLOURS[1 << k]) for k in range(LABEL_BITS)),
    "bgr": (BLUE_CURVE, GREEN_CURVE, RED_CURVE),
    "rgb": (RED_CURVE, GREEN_CURVE, BLUE_CURVE),
}
"""Names of the lights, and colours of their labels."""


def draw_touch(
    touch: Touch, top: float, footer: str, lights: Lights = "leds", chosen: str | None = None
) -> Picture:
    """Draw height, camera image and a layer side by side.

    Parameters
    ----------
    touch
        Shown are its height; LED 1, or the colours, with layers that are arrows; and a layer.
    top : upper end of the height's colour scale in mm
    footer : one line of text
    lights : "bgr" or "rgb" if the lights are the colours of one picture
    chosen : the layer's name; None: the first labels

    Raises
    ------
    InputError
        If the touch has no such map.
    """
    height, image, drawings = touch.height, touch.image, touch.drawings
    rows, columns = height.shape
    width = round(HEIGHT_PX * columns / rows)
    half = (HEIGHT_PX - TITLE_PX - GAP_PX) // 2
    small = round(half * columns / rows)
    bar = GAP_PX + width + GAP_PX
    right = bar + BAR_PX + BAR_TEXT_PX
    upper, lower = GAP_PX + TITLE_PX, GAP_PX + 2 * TITLE_PX + half + GAP_PX
    size = upper + HEIGHT_PX + TITLE_PX + GAP_PX, right + small + GAP_PX
    canvas = np.full((*size, 3), BACKGROUND_RGB, np.uint8)
    mean = _grey(image, small, half)
    first = _grey(image[:1], small, half) if lights == "leds" else _coloured(image, lights, mean)
    for drawing in drawings.values():
        if isinstance(drawing, Arrows):
            first = np.ascontiguousarray(first)
            drawing.draw(first, small / columns)
    layer = _chosen(drawings, chosen)
    beneath, title = _dimmed(mean), ""
    if layer is not None:
        beneath, title = _drawn(touch.layers[layer], drawings[layer], mean, lights)
    _place(canvas, colour_height(_resized(height, width, HEIGHT_PX), top), GAP_PX, upper)
    levels = np.linspace(255, 0, HEIGHT_PX).astype(np.uint8)
    _place(canvas, np.repeat(_colours()[levels][:, None], BAR_PX, axis=1), bar, upper)
    _place(canvas, first, right, upper)
    _place(canvas, beneath, right, lower)

    page = Image.fromarray(canvas)
    pen = ImageDraw.Draw(page)
    _write(pen, GAP_PX, GAP_PX, "height above the film at rest")
    _write(pen, right, GAP_PX, "camera, LED 1" if lights == "leds" else "camera")
    _write(pen, right, lower - TITLE_PX, title)
    if layer is not None and _is_of_leds(drawings[layer]):
        _legend(pen, right + small, lower - TITLE_PX, LIGHT_NAMES[lights][: image.shape[0]])
    _ticks(pen, bar, upper, top)
    _scale_bar(pen, GAP_PX, upper + HEIGHT_PX, width, columns * touch.pixel)
    _write(pen, GAP_PX, upper + HEIGHT_PX + 8, footer)
    return np.asarray(page)


def _chosen(drawings: Mapping[str, Any], name: str | None) -> str | None:
    """The layer that is shown beneath the image."""
    if name is None:
        return next((each for each, how in drawings.items() if _is_of_leds(how)), None)
    maps = [each for each, how in drawings.items() if isinstance(how, LabelMap | ColourMap)]
    if name not in maps:
        has = f"it has {', '.join(maps)}" if maps else "it has none"
        raise InputError(f"`layer`={name}: the touch has no such map; {has}")
    return name


def _is_of_leds(drawing: Any) -> bool:
    return isinstance(drawing, LabelMap) and drawing.leds


def _drawn(value: Any, how: Any, grey: Picture, lights: Lights) -> tuple[Picture, str]:
    """A layer's picture, of the size of the grey one, and its title."""
    if isinstance(how, LabelMap):
        return _labelled(value, grey, _label_colours(how, lights)), how.title
    plane = np.float32(how.scale) * _resized(value, *grey.shape[1::-1])
    least, most = float(np.nanmin(plane)), float(np.nanmax(plane))
    words = f"{how.title}: {least:.3g} to {most:.3g} {how.unit}"
    return colour_height(plane - least, most - least or 1.0), words


def colour_height(height: Height, top: float) -> Picture:
    """Heights as colours from dark (0) to light (`top`, mm); grey where not finite."""
    # The mean shows faster than a mask whether there is any NaN.
    is_known = np.isfinite(height) if not np.isfinite(height.mean()) else None
    finite = height if is_known is None else np.where(is_known, height, 0)
    coloured = _colours()[cv2.convertScaleAbs(np.maximum(finite, 0), alpha=255 / top)]
    if is_known is not None:
        coloured[~is_known] = UNKNOWN_RGB
    return coloured


def has_screen() -> bool:
    """Return whether a window can open; without a display OpenCV's end the whole program."""
    return sys.platform != "linux" or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))


def scale_top(height: Height, top: float) -> float:
    """Upper end of the height's colour scale in mm: `top`, the last one, or a larger one."""
    highest = float(height.max())
    return max(top, round_up(highest) if highest > 0 else MIN_TOP_MM)


def round_up(value: float) -> float:
    """Round up to 1, 2, 5 or 10 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(max(value, 1e-9)))
    return next(step * power for step in (1, 2, 5, 10) if step * power >= value * (1 - 1e-9))


def _grey(image: Light, width: int, height: int) -> Picture:
    mean = np.mean([_resized(plane, width, height) for plane in image], axis=0)
    return np.asarray(cv2.cvtColor(_as_bytes(mean), cv2.COLOR_GRAY2RGB))


def _as_bytes(light: F4) -> NDArray[np.uint8]:
    """The light in 8 bits, `WHITE_SHARE` of its pixels below white."""
    white = float(np.quantile(light[::4, ::4], WHITE_SHARE)) or 1.0
    return np.asarray(cv2.convertScaleAbs(light, alpha=255 / white), np.uint8)


def _coloured(image: Light, lights: Lights, like: Picture) -> Picture:
    """The lights in their true colours."""
    rows, columns = like.shape[:2]
    planes = [_resized(plane, columns, rows) for plane in image]
    picture = np.stack(planes if lights == "rgb" else planes[::-1], axis=-1)
    return _as_bytes(picture)


def _dimmed(grey: Picture) -> Picture:
    return np.asarray(cv2.convertScaleAbs(grey, alpha=DIMMED_SHARE), np.uint8)


def _labelled(numbers: NDArray[np.uint8], grey: Picture, colours: Picture) -> Picture:
    rows, columns = grey.shape[:2]
    labels = cv2.resize(numbers, (columns, rows), interpolation=cv2.INTER_NEAREST)
    dim = _dimmed(grey)
    mixed = cv2.addWeighted(dim, 1 - LABEL_OPACITY, colours[labels], LABEL_OPACITY, 0)
    return np.where(labels[..., None] > 0, mixed, dim)


@lru_cache
def _label_colours(how: LabelMap, lights: Lights) -> Picture:
    """A colour for each of the 256 labels; of an LED its own."""
    colours = how.colours
    if how.leds:
        for k, (_, colour) in enumerate(LIGHT_NAMES[lights]):
            colours[1 << k] = colour
    return np.array([[*bytes.fromhex(colour[1:])] for colour in colours], np.uint8)


@lru_cache
def _colours() -> Picture:
    """256 x 3, from dark to light, perceptually uniform."""
    ramp = np.arange(256, dtype=np.uint8)[:, None]
    bgr = cv2.applyColorMap(ramp, cv2.COLORMAP_VIRIDIS)
    return np.asarray(bgr[:, 0, ::-1], np.uint8)


def _resized(plane: F4, width: int, height: int) -> F4:
    how = cv2.INTER_AREA if width < plane.shape[1] else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(plane, (width, height), interpolation=how))


def _place(canvas: Picture, picture: Picture, x: int, y: int) -> None:
    canvas[y : y + picture.shape[0], x : x + picture.shape[1]] = picture


@lru_cache
def _font() -> Any:
    return ImageFont.load_default(TEXT_PX)


def _write(pen: ImageDraw.ImageDraw, x: float, y: float, text: str, anchor: str = "la") -> None:
    pen.text((x, y), text, fill=TEXT_RGB, font=_font(), anchor=anchor)


def _ticks(pen: ImageDraw.ImageDraw, x: int, y: int, top: float) -> None:
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        at = y + (1 - share) * (HEIGHT_PX - 1)
        pen.line((x + BAR_PX, at, x + BAR_PX + 4, at), fill=TEXT_RGB)
        inside = min(max(at, y + 8), y + HEIGHT_PX - 8)
        _write(pen, x + BAR_PX + 8, inside, f"{share * top:.3g}", "lm")
    _write(pen, x, y - 8, "mm", "lb")


def _scale_bar(pen: ImageDraw.ImageDraw, x: int, bottom: int, width: int, mm: float) -> None:
    """Draw a scale bar of 1, 2 or 5 mm (or tenths, tens), about a fifth of the picture wide."""
    length = round_up(mm / 8)
    across = width * length / mm
    y = bottom - 16
    pen.rectangle((x + 14, y, x + 14 + across, y + 4), fill="white")
    _write(pen, x + 14 + across / 2, y - 4, f"{length:g} mm", "mb")


def _legend(
    pen: ImageDraw.ImageDraw, right: int, y: int, names: tuple[tuple[str, str], ...]
) -> None:
    entries = [*names, ("several", LED_COLOURS[0b11])]
    for text, colour in reversed(entries):
        right -= round(pen.textlength(text, font=_font()))
        _write(pen, right, y, text)
        right -= 16
        pen.rectangle((right, y + 2, right + 11, y + 13), fill=colour, outline=TEXT_RGB)
        right -= 10
