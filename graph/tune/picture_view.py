"""A picture on the page that is replaced many times a second."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from nicegui import events, ui


class Pointed(NamedTuple):
    """The place of the mouse in pixels of the picture."""

    x: float
    y: float
    pressed: bool


class PictureView(ui.element, component="picture_view.js"):
    """A picture with lines on it and a cross under the cursor; `Follow.picture` puts one in."""

    def __init__(self, over: Callable[[Pointed], None]) -> None:
        super().__init__()

        def told(event: events.GenericEventArguments) -> None:
            over(Pointed(event.args["x"], event.args["y"], event.args["pressed"]))

        self.on("mouse", told, ["x", "y", "pressed"])
        self.classes("t-picture")
