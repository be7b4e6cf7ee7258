"""A camera in its own thread: timed frames, of which the newest are kept, and fault counters."""

import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from typing import Any, NamedTuple

import cv2
import numpy as np

from tactograph.rings.live.nodes.camera.open_camera import CameraSettings, Capture, Plane, settle
from tactograph.sdk import InputError

REOPEN_PAUSE_S = 0.1
"""Seconds between two attempts to open a camera."""


class Shot(NamedTuple):
    """A raw frame: its number, and the end of its exposure in s of time.monotonic()."""

    number: int
    time: float
    data: Plane


class Camera:
    """Fetches frames in its own thread; reopens the camera whenever it fails.

    Parameters
    ----------
    connect : opens the camera; called again after every failure
    settings : the requested settings
    queue : most frames that wait; older ones are dropped and counted
    timeout : seconds without a frame after which the camera is reopened
    once : whether the stream ends with the frames, as of a file

    Attributes
    ----------
    faults : counts of "dropped", "camera lost", and "lost" if the kernel numbers frames
    refused : settings that the driver refused at the last opening
    connections : how often the camera was opened
    """

    def __init__(
        self,
        connect: Callable[[], Capture],
        settings: CameraSettings,
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
        self._settings = settings
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
        self.reopen()

    def shots(self, wait: float) -> list[Shot]:
        """All waiting frames, oldest first; waits at most `wait` seconds for the first one.

        A thread that hangs in its driver is abandoned, and another one is started.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._shots or self.ended, wait)
            shots = list(self._shots)
            self._shots.clear()
        # A driver may block for much longer than a frame, and for even longer while opening.
        if not shots and time.monotonic() - self._alive > self._timeout + REOPEN_PAUSE_S:
            self._lost()
            self.reopen()
        return shots

    def check(self, wait: float, name: object) -> None:
        """Wait for a first frame, and check that it has the requested size.

        Parameters
        ----------
        wait : longest time to wait, in seconds
        name : the user's name for the camera

        Raises
        ------
        InputError
            If the camera cannot be opened, or delivers nothing, another size, or grey pictures
            instead of colours.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._shots or self.ended or self._refused, wait)
            first = self._shots[0] if self._shots else None
        if first is None:
            why = "delivers no frame" if self.connections else "cannot be opened"
            raise InputError(
                f"`camera`={name}: {why}; look at its cable, whether another program has it, and "
                "whether you are in the group 'video'"
            )
        if self._settings.colour and first.data.ndim < 3:
            raise InputError(
                f"`camera`={name}: delivers grey pictures, but a one-shot sensor's lights are the "
                "colours of one picture"
            )
        height, width = first.data.shape[:2]
        view = self._settings.view
        size_px = (
            view.size if view else (self._settings.width or width, self._settings.height or height)
        )
        if (width, height) != size_px:
            raise InputError(
                f"`camera`={name}: delivers {width} x {height} pixels, but the calibration is for "
                f"{size_px[0]} x {size_px[1]}; calibrate with this camera"
            )

    def close(self) -> None:
        """Release the camera; waits no longer than the timeout."""
        self._closed.set()
        self._stop.set()
        self._thread.join(self._timeout)

    def reopen(self) -> None:
        """Open the camera in a new thread, as after a failure."""
        self._stop.set()
        self._alive = time.monotonic() + 2 * self._timeout
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(self._stop,), daemon=True)
        self._thread.start()

    def _run(self, stop: threading.Event) -> None:
        """Open the camera, fetch until it fails, and repeat."""
        while not stop.is_set():
            capture = self._opened()
            if capture is None:
                stop.wait(REOPEN_PAUSE_S)
                continue
            self._fetch(capture, stop)
            capture.release()
            if stop.is_set():
                return
            if self._once:
                self._end()
                return
            self._lost()
            stop.wait(REOPEN_PAUSE_S)

    def _opened(self) -> Capture | None:
        try:
            capture = self._connect()
            if capture.isOpened():
                self.refused = settle(capture, self._settings)
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
        rate = capture.get(cv2.CAP_PROP_FPS) if self._once else 0.0
        due = time.monotonic()
        while not stop.is_set():
            if rate > 0:  # a file, at its own rate
                stop.wait(max(due - time.monotonic(), 0))
                due += 1 / rate
            try:
                if not capture.grab():
                    return
                arrival_s = time.monotonic()
                arrived, frame = capture.retrieve()
            except cv2.error:
                return
            if not arrived or frame is None or stop.is_set():
                return
            self._alive = time.monotonic()
            self._put(
                _moment(capture, arrival_s), self._plane(frame), getattr(capture, "sequence", None)
            )

    def _plane(self, frame: Any) -> Plane:
        plane = _colours(frame) if self._settings.colour else _grey(frame)
        return self._settings.view.of(plane) if self._settings.view else plane

    def _put(self, moment: float, data: Plane, sequence: int | None) -> None:
        """Queue a frame; the kernel's numbers show how many are missing before it."""
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


def _moment(capture: Capture, arrival_s: float) -> float:
    """The driver's time of the frame if it is on the host's clock, else the time of arrival."""
    driver_s = 1e-3 * capture.get(cv2.CAP_PROP_POS_MSEC)
    return driver_s if 0 <= arrival_s - driver_s < 1 else arrival_s


def _grey(frame: Any) -> Plane:
    """One plane; a grey camera behind a colour interface has three equal ones."""
    plane = np.asarray(frame)
    if plane.ndim == 3:
        plane = plane[..., 0] if plane.shape[2] == 1 else cv2.cvtColor(plane, cv2.COLOR_BGR2GRAY)
    return np.ascontiguousarray(plane)


def _colours(frame: Any) -> Plane:
    """H x W x 3 in the driver's order; grey stays grey."""
    picture = np.asarray(frame)
    if picture.ndim == 3 and picture.shape[2] == 1:
        picture = picture[..., 0]
    return np.ascontiguousarray(picture[..., :3] if picture.ndim == 3 else picture)
