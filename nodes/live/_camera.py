"""A camera in its own thread: frames with times, the newest winning, faults counted."""

from __future__ import annotations

import os
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, Protocol, cast

# V4L2 waits so many seconds for a frame of a camera that has stopped; OpenCV's own 10 would
# keep the thread from opening it again.  Read at the first wait.
os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.graph import InputError
from tactograph.nodes.live._camera_names import NODE, device_of
from tactograph.nodes.live._linux_camera import LinuxCapture, linuxpy

Library = Literal["opencv", "linuxpy"]
Plane = NDArray[np.uint8] | NDArray[np.uint16]

PAUSE = 0.1
"""Seconds between two attempts to open a camera."""
NET_TIMEOUTS = (cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, 1000, cv2.CAP_PROP_READ_TIMEOUT_MSEC, 1000)
"""OpenCV's own are half a minute."""
FILES = ("FFMPEG", "CV_MJPEG", "CV_IMAGES", "GSTREAMER")
"""Back ends whose pictures come from files or the net: they have no exposure to set."""


class Capture(Protocol):
    """What of ``cv2.VideoCapture`` is used: anything that has it can be the camera."""

    def isOpened(self) -> bool: ...  # noqa: N802
    def grab(self) -> bool: ...
    def retrieve(self) -> tuple[bool, Any]: ...
    def get(self, prop: int) -> float: ...
    def set(self, prop: int, value: float) -> bool: ...
    def getBackendName(self) -> str: ...  # noqa: N802
    def release(self) -> None: ...


@dataclass(frozen=True)
class View:
    """The part of the camera's picture that is the film, and the size that it is brought to.

    Parameters
    ----------
    turn_deg
        Counter-clockwise: 0, 90, 180 or 270.
    crop
        Left, top, right and bottom as shares of the turned picture.
    size
        Width and height of the frames.
    """

    turn_deg: int
    crop: tuple[float, float, float, float]
    size: tuple[int, int]

    def of(self, picture: Plane) -> Plane:
        """Turn, cut and shrink a picture, H x W or H x W x 3."""
        turned: Any = np.rot90(picture, self.turn_deg // 90)
        rows, columns = turned.shape[:2]
        left, top, right, bottom = self.crop
        part = np.ascontiguousarray(
            turned[round(top * rows) : round(bottom * rows)][
                :, round(left * columns) : round(right * columns)
            ]
        )
        if part.shape[1::-1] != self.size:
            part = cv2.resize(part, self.size, interpolation=cv2.INTER_AREA)
        return cast(Plane, part)


@dataclass(frozen=True)
class Wanted:
    """What the camera is asked for; None leaves a property as the driver has it.

    Frames in `colour` are H x W x 3 as the driver gives them, else H x W.  Where there is a
    `view`, frames are that of the camera's pictures.
    """

    width: int | None
    height: int | None
    rate: float
    exposure: float | None = None
    gain: float | None = None
    white_balance: float | None = None
    colour: bool = False
    format: str | None = None
    view: View | None = None


class Shot(NamedTuple):
    """A frame as it came: counted, with the end of its exposure in s of time.monotonic()."""

    number: int
    time: float
    data: Plane


def open_capture(
    camera: int | str, library: Library = "opencv", *, colour: bool = False
) -> Capture:
    """Open a camera by index, serial number, path or URL; it may turn out not to be opened."""
    try:
        text = device_of(str(camera))
    except InputError:
        return cv2.VideoCapture()  # it is unplugged
    if library == "linuxpy":
        return LinuxCapture(f"/dev/video{text}" if text.isdecimal() else text, colour=colour)
    # We report once what cannot be opened.
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    node = NODE.fullmatch(text)
    if node:
        return cv2.VideoCapture(int(node[1]), cv2.CAP_V4L2)
    if text.isdecimal():
        return cv2.VideoCapture(int(text))
    if "://" in text:
        return cv2.VideoCapture(text, cv2.CAP_FFMPEG, list(NET_TIMEOUTS))
    return cv2.VideoCapture(text)


def settle(capture: Capture, wanted: Wanted) -> list[str]:
    """Fix size, rate, exposure, gain and white balance; return what the driver refused.

    A camera that sets its own exposure or gain makes the light of one LED depend on that of
    the others: nothing could be measured.
    """
    if capture.getBackendName() in FILES:
        return []
    automatic = [
        (cv2.CAP_PROP_AUTO_EXPOSURE, _manual(capture), "automatic exposure off", True),
        (cv2.CAP_PROP_AUTO_WB, 0.0, "automatic white balance off", wanted.colour),
        (cv2.CAP_PROP_AUTOFOCUS, 0.0, "automatic focus off", False),
    ]
    code = None if wanted.format is None else float(cv2.VideoWriter.fourcc(*wanted.format))
    chosen = [
        (cv2.CAP_PROP_FOURCC, code, "pixel format", False),
        (cv2.CAP_PROP_FRAME_WIDTH, wanted.width, "width", True),
        (cv2.CAP_PROP_FRAME_HEIGHT, wanted.height, "height", True),
        (cv2.CAP_PROP_FPS, wanted.rate, "frames per second", True),
        (cv2.CAP_PROP_EXPOSURE, wanted.exposure, "exposure", True),
        (cv2.CAP_PROP_GAIN, wanted.gain, "gain", True),
        (cv2.CAP_PROP_WB_TEMPERATURE, wanted.white_balance, "white balance", True),
    ]
    if capture.getBackendName() == "SIMULATED":
        automatic = []
    refused = []
    for prop, value, name, matters in automatic + chosen:
        if value is None:
            continue
        capture.set(prop, float(value))
        found = capture.get(prop)
        if matters and abs(found - value) > 0.02 * max(abs(value), 1):
            refused.append(f"the camera keeps {name} at {found:g} instead of {value:g}")
    return refused


def _manual(capture: Capture) -> float:
    """The value that means manual exposure: V4L2's menu has 1, the others a quarter."""
    return 1.0 if capture.getBackendName() in ("V4L2", "V4L") else 0.25


class Camera:
    """Fetches frames in a thread of its own; opens the camera again whenever it fails.

    Parameters
    ----------
    connect
        Opens the camera; called again after every failure.
    wanted
        What it is asked for.
    queue
        Frames that wait at most; older ones are dropped and counted.
    timeout
        Seconds without a frame after which the camera is opened again.
    once
        Whether the end of the frames is the end: a file.

    Attributes
    ----------
    faults
        How often what happened: "dropped", "camera lost", and "lost" where the kernel counts.
    refused
        What the driver did not do at the last opening.
    connections
        How often the camera was opened.
    """

    def __init__(
        self,
        connect: Callable[[], Capture],
        wanted: Wanted,
        *,
        queue: int = 8,
        timeout: float = 0.5,
        once: bool = False,
    ) -> None:
        self.faults: Counter[str] = Counter()
        self.refused: list[str] = []
        self.connections = 0
        self.ended = False
        self._connect = connect
        self._wanted = wanted
        self._timeout = timeout
        self._once = once
        self._refused = False
        self._number = 0
        self._sequence: int | None = None
        self._shots: deque[Shot] = deque(maxlen=queue)
        self._changed = threading.Condition()
        self._alive = time.monotonic()
        self._closed = threading.Event()
        self._stop = threading.Event()
        self._start()

    def shots(self, wait: float) -> list[Shot]:
        """All frames that wait, oldest first; at most `wait` seconds for the first of them.

        A thread that hangs in its driver is left to itself, and another one started.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._shots or self.ended, wait)
            shots = list(self._shots)
            self._shots.clear()
        # A driver may block far longer than a frame takes; opening is given longer still.
        if not shots and time.monotonic() - self._alive > self._timeout + PAUSE:
            self._lost()
            self._start()
        return shots

    def check(self, wait: float, name: object) -> None:
        """Wait for a first frame, and see that it has the size that is wanted.

        Parameters
        ----------
        wait
            Seconds to wait at most.
        name
            What the user calls the camera.

        Raises
        ------
        InputError
            If the camera cannot be opened, delivers nothing, or another size, or grey pictures
            where colours are wanted.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._shots or self.ended or self._refused, wait)
            first = self._shots[0] if self._shots else None
        if first is None:
            why = "delivers no frame" if self.connections else "cannot be opened"
            raise InputError(
                f"camera={name}: {why}; look at its cable, whether another program has it, and "
                "whether you are in the group 'video'"
            )
        if self._wanted.colour and first.data.ndim < 3:
            raise InputError(
                f"camera={name}: delivers grey pictures, but a one-shot sensor's lights are the "
                "colours of one picture"
            )
        height, width = first.data.shape[:2]
        view = self._wanted.view
        wanted = view.size if view else (self._wanted.width or width, self._wanted.height or height)
        if (width, height) != wanted:
            raise InputError(
                f"camera={name}: delivers {width} x {height} pixels, but the calibration is for "
                f"{wanted[0]} x {wanted[1]}; calibrate with this camera"
            )

    def reopen(self) -> None:
        """Open the camera again, as after a failure."""
        self._start()

    def close(self) -> None:
        """Release the camera; waits no longer than the timeout."""
        self._closed.set()
        self._stop.set()
        self._thread.join(self._timeout)

    def _start(self) -> None:
        self._stop.set()
        self._alive = time.monotonic() + 2 * self._timeout
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(self._stop,), daemon=True)
        self._thread.start()

    def _run(self, stop: threading.Event) -> None:
        """Open, fetch until it fails, and again."""
        while not stop.is_set():
            capture = self._opened()
            if capture is None:
                stop.wait(PAUSE)
                continue
            self._fetch(capture, stop)
            capture.release()
            if stop.is_set():
                return
            if self._once:
                self._end()
                return
            self._lost()
            stop.wait(PAUSE)

    def _opened(self) -> Capture | None:
        try:
            capture = self._connect()
            if capture.isOpened():
                self.refused = settle(capture, self._wanted)
                self._sequence = None
                self.connections += 1
                return capture
            capture.release()
        except cv2.error:
            pass
        with self._changed:
            self._alive = time.monotonic()
            self._refused = not self.connections
            self._changed.notify()
        return None

    def _fetch(self, capture: Capture, stop: threading.Event) -> None:
        pace = _FilePace(capture) if self._once else None
        while not stop.is_set():
            if pace is not None:
                pace.wait(stop)
            try:
                if not capture.grab():
                    return
                come = time.monotonic()
                there, frame = capture.retrieve()
            except cv2.error:
                return
            if not there or frame is None or stop.is_set():
                return
            self._alive = time.monotonic()
            self._put(
                _moment(capture, come), self._plane(frame), getattr(capture, "sequence", None)
            )

    def _plane(self, frame: Any) -> Plane:
        plane = _colours(frame) if self._wanted.colour else _grey(frame)
        return self._wanted.view.of(plane) if self._wanted.view else plane

    def _put(self, moment: float, data: Plane, sequence: int | None) -> None:
        """Queue a frame; by the kernel's numbers it is known what is missing before it."""
        with self._changed:
            if sequence is not None:
                if self._sequence is not None and sequence > self._sequence + 1:
                    self.faults["lost"] += sequence - self._sequence - 1
                    self._number += sequence - self._sequence - 1
                self._sequence = sequence
            if len(self._shots) == self._shots.maxlen:
                self.faults["dropped"] += 1
            self._shots.append(Shot(self._number, moment, data))
            self._number += 1
            self._changed.notify()

    def _lost(self) -> None:
        if self.connections and not self._closed.is_set():
            self.faults["camera lost"] += 1

    def _end(self) -> None:
        with self._changed:
            self.ended = True
            self._changed.notify()


class _FilePace:
    """Lets a file's frames come at the file's own rate."""

    def __init__(self, capture: Capture) -> None:
        rate = capture.get(cv2.CAP_PROP_FPS)
        self._step = 1 / rate if rate > 0 else 0.0
        self._next = time.monotonic()

    def wait(self, stop: threading.Event) -> None:
        stop.wait(max(self._next - time.monotonic(), 0))
        self._next += self._step


def _moment(capture: Capture, come: float) -> float:
    """The driver's time of the frame if it is of the host's clock, else when it came."""
    told = 1e-3 * capture.get(cv2.CAP_PROP_POS_MSEC)
    return told if 0 <= come - told < 1 else come


def _grey(frame: Any) -> Plane:
    """One plane; a grey camera behind a colour interface has three equal ones."""
    plane = np.asarray(frame)
    if plane.ndim == 3:
        plane = plane[..., 0] if plane.shape[2] == 1 else cv2.cvtColor(plane, cv2.COLOR_BGR2GRAY)
    return np.ascontiguousarray(plane)


def _colours(frame: Any) -> Plane:
    """Three planes, one beside another, as the driver orders them; grey stays grey."""
    picture = np.asarray(frame)
    if picture.ndim == 3 and picture.shape[2] == 1:
        picture = picture[..., 0]
    return np.ascontiguousarray(picture[..., :3] if picture.ndim == 3 else picture)


def check_camera(camera: int | str, library: Library = "opencv") -> bool:
    """Whether `camera` is a file; a path that names nothing is refused.

    Raises
    ------
    InputError
        If it looks like a path and there is nothing, or no camera has its serial number, or the
        library is not installed.
    """
    if library == "linuxpy":
        linuxpy()
    text = device_of(str(camera))
    if text.isdecimal() or "://" in text or text.startswith("/dev/"):
        return False
    if not Path(text).is_file():
        raise InputError(
            f"camera={text}: there is no such file; give an index, serial:..., a path, a URL or "
            "'simulated'"
        )
    return True
