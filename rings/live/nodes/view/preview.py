"""Show a stream of touches: in a window if there is a screen, else as PNG files."""

import math
import time as clock
from collections import deque
from pathlib import Path
from typing import Annotated, Literal

import cv2
from annotated_types import Gt

from tactograph.rings.live.nodes.view._live_picture import (
    Picture,
    draw_touch,
    has_screen,
    scale_top,
)
from tactograph.sdk import (
    ImageFile,
    InputError,
    Lights,
    LiveState,
    Session,
    Touch,
    atomic_files,
    node,
    warn,
)

RATE_WINDOW_S = 2.0
CLOSING_KEYS = (27, ord("q"))
Where = Literal["auto", "window", "files"]


@node
def preview(
    touch: Touch,
    *,
    lights: Lights = "leds",
    where: Where = "auto",
    folder: Path = Path("preview"),
    rate_hz: Annotated[float, Gt(0)] = 10.0,
    top_mm: Annotated[float, Gt(0)] | None = None,
    layer: str | None = None,
    session: Session,
) -> None:
    """Show the height in colour, the camera's image, a layer of the touch and the rates.

    Without a screen, or with an OpenCV without windows, the picture goes to
    ``folder/latest.png``, which is always a complete file.  A window that the user closes
    (also by q or Escape) stays closed; the stream goes on.

    Parameters
    ----------
    touch
        As `join_touch` makes it.  Shown are LED 1, or the colours, with the arrows of its layers,
        and beneath them one layer: labels and regions over the mean image, or a map.
    lights : "bgr" or "rgb" if the lights are the colours of one picture, see `read_camera`
    where : "auto": a window if possible, else files
    folder : for the PNG files
    rate_hz : most pictures per second; touches in between are not drawn
    top_mm : upper end of the height's colour scale; None: the greatest height so far, rounded up
    layer : name of the layer beneath the camera's image; None: the first labels

    Raises
    ------
    InputError
        If a window is requested but impossible, the folder cannot be written when the preview
        begins, or the touch has no such layer.
    """
    screen = session.keep(lambda: _Preview(_open_screen(where, folder), 1 / rate_hz))
    screen.count(touch)
    if screen.is_due():
        screen.top = top_mm or scale_top(touch.height, screen.top)
        picture = draw_touch(touch, screen.top, screen.footer(touch.state), lights, layer)
        screen.show(picture)


class _Window:
    """An OpenCV window."""

    title = "tactograph"

    def __init__(self) -> None:
        cv2.namedWindow(self.title, cv2.WINDOW_NORMAL | cv2.WINDOW_KEEPRATIO)
        self._began = False

    def show(self, picture: Picture) -> str:
        """Draw a picture; return why no more can be shown, empty if they can."""
        closed = "the window was closed"
        if not self._began:
            cv2.resizeWindow(self.title, picture.shape[1], picture.shape[0])
        elif cv2.getWindowProperty(self.title, cv2.WND_PROP_VISIBLE) < 1:
            return closed
        self._began = True
        cv2.imshow(self.title, picture[..., ::-1])
        return closed if cv2.waitKey(1) & 0xFF in CLOSING_KEYS else ""

    def close(self) -> None:
        cv2.destroyAllWindows()


class _Files:
    """``latest.png``."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._wrote = False

    def show(self, picture: Picture) -> str:
        """Write a picture; return why that has become impossible, empty if it has not."""
        try:
            with atomic_files(self._folder) as target:
                ImageFile(target / "latest.png").write(picture[..., ::-1])
        except InputError as error:
            if not self._wrote:
                raise
            return str(error)
        self._wrote = True
        return ""

    def close(self) -> None:
        """Do nothing: no file is open between two pictures."""


class _Preview:
    """The pictures' destination, the time of the next one, and the rates."""

    def __init__(self, screen: _Window | _Files, pause: float) -> None:
        self._screen, self._pause = screen, pause
        self._due = 0.0
        self.top = 0.0
        self._arrivals: deque[tuple[float, int]] = deque()
        self._latency_s: float | None = None

    def count(self, touch: Touch) -> None:
        """Count a touch, and note its latency."""
        now = clock.monotonic()
        self._arrivals.append((now, touch.state.frames if touch.state else 0))
        while now - self._arrivals[0][0] > RATE_WINDOW_S:
            self._arrivals.popleft()
        self._latency_s = touch.latency_s(now)

    def is_due(self) -> bool:
        return clock.monotonic() >= self._due

    def footer(self, state: LiveState | None) -> str:
        (start, frames), (end, last) = self._arrivals[0], self._arrivals[-1]
        parts = []
        if end > start:
            parts.append(f"{(len(self._arrivals) - 1) / (end - start):.1f} touches/s")
            if state is not None:
                parts.append(f"{(last - frames) / (end - start):.1f} frames/s")
        if self._latency_s is not None:
            parts.append(f"latency {1e3 * self._latency_s:.0f} ms")
        if state is not None:
            parts.append(f"dropped {state.dropped}")
            others = [each for each in state.faults.most_common(4) if each[0] != "dropped"]
            parts += [f"{fault} {count}" for fault, count in others[:3]]
        return "     ".join(parts)

    def show(self, picture: Picture) -> None:
        self._due = clock.monotonic() + self._pause
        if reason := self._screen.show(picture):
            warn(f"preview: {reason}; the stream goes on without it")
            self._due = math.inf
            self.close()

    def close(self) -> None:
        self._screen.close()


def _open_screen(where: Where, folder: Path) -> _Window | _Files:
    if where == "files":
        return _Files(folder)
    reason = _why_no_window()
    if reason is None:
        return _Window()
    if where == "window":
        raise InputError(f"preview: {reason}; `where`=files writes pictures instead")
    warn(f"preview: {reason}; pictures go to {folder / 'latest.png'}")
    return _Files(folder)


def _why_no_window() -> str | None:
    if not has_screen():
        return "there is no screen (DISPLAY is not set)"
    try:
        cv2.namedWindow(_Window.title, cv2.WINDOW_NORMAL)
        cv2.destroyWindow(_Window.title)
    except cv2.error:
        return "this OpenCV has no windows (opencv-contrib-python has, -headless has not)"
    return None
