"""A picture on the page that is replaced many times a second, its colour bar and its value."""

import math
from collections.abc import Callable
from html import escape
from typing import NamedTuple

from nicegui import ui

from tactograph.rings.tune.follow import Follow
from tactograph.rings.tune.pictures import Picture, gradient


class Pointed(NamedTuple):
    """The place of the mouse in pixels of the picture."""

    x: float
    y: float
    pressed: bool


class PictureView(ui.element, component="picture_view.js"):
    """A picture with lines on it and a cross under the cursor; `Follow.picture` puts one in."""

    def __init__(self, over: Callable[[Pointed], None]) -> None:
        super().__init__()
        self.on("mouse", lambda event: over(Pointed(**event.args)), [*Pointed._fields])
        self.classes("t-picture")


class ScaledPicture:
    """A picture, a colour bar and its scale; `add_value` adds the value under the cursor.

    Tests know it by `name`; `pressed` is called where the mouse is pressed in it.
    """

    def __init__(
        self, follow: Follow, name: str, pressed: Callable[[Pointed], None] | None = None
    ) -> None:
        self._follow, self._pressed = follow, pressed
        self.picture: Picture | None = None
        self._view = PictureView(self._over).props(f"data-testid={name}")
        self._bar = ui.element("div").classes("t-bar")
        self._scale = ui.html("", sanitize=False).classes("t-scale")
        self._value: ui.html | None = None

    def add_value(self, name: str) -> None:
        """Show here the value under the cursor."""
        self._value = ui.html("", sanitize=False).classes("t-under")
        self._value.props(f"data-testid={name}")

    def show(self, picture: Picture, lines: str, height_vh: int) -> None:
        """Show a picture with lines on it, no higher than a part of the window."""
        self.picture = picture
        width, height = picture.size
        self._follow.picture(self._view, picture.uri, picture.size, lines)
        self._view.style(f"max-width: calc({height_vh}vh * {width / height:.3f})")
        if not picture.is_map:
            self._follow.background(self._bar, "none")
            marks: tuple[str, ...] = (picture.unit,)
        else:
            self._follow.background(self._bar, f"linear-gradient(to top, {gradient()})")
            middle = (picture.low + picture.high) / 2
            marks = f"{picture.high:.4g} {picture.unit}", f"{middle:.4g}", f"{picture.low:.4g}"
        self._follow.html(self._scale, "".join(f"<span>{escape(mark)}</span>" for mark in marks))

    def set_visibility(self, visible: bool) -> None:
        for part in (self._view, self._bar, self._scale):
            part.set_visibility(visible)

    def _over(self, mouse: Pointed) -> None:
        if self.picture is None:
            return
        if self._value is not None:
            self._follow.html(self._value, escape(_value_at(self.picture, mouse)))
        if mouse.pressed and self._pressed is not None:
            self._pressed(mouse)


def _value_at(picture: Picture, mouse: Pointed) -> str:
    """Place and value under the cursor."""
    height, width = picture.array.shape
    column, row = math.floor(mouse.x), math.floor(mouse.y)
    if not (0 <= column < width and 0 <= row < height):
        return ""
    value = picture.array[row, column]
    text = f"{value:.5g}" if picture.array.dtype.kind == "f" else f"{value}"
    return f"x {column}  y {row}   {text} {picture.unit}"
