"""A sensor's heights or lights as a camera of LeRobot's."""

import math
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from lerobot.cameras.camera import Camera
from lerobot.cameras.configs import CameraConfig
from numpy.typing import NDArray

from tactograph.rings.export.height_levels import height_levels
from tactograph.rings.frames.calibrated_film import calibrated_film
from tactograph.rings.frames.colour_planes import MAX_BYTE
from tactograph.rings.recording.files.lerobot_rows import PICTURE_CHANNELS, lights_picture
from tactograph.rings.recording.files.level_pictures import levels_picture
from tactograph.sdk import load

START_S = 60.0
"""Longest wait for the first picture: the graph is compiled before."""
END_S = 5.0
"""Longest wait for a stream to end."""
PICTURE_SOURCES = {"height": "height", "levels": "height", "lights": "frames.image"}
"""What each picture is made of: a node's output."""


@CameraConfig.register_subclass("tactograph")
@dataclass(kw_only=True)
class TactographCameraConfig(CameraConfig):
    """The sensor, and what its pictures show.

    Parameters
    ----------
    calibration
        The sensor's ``.npz``; it gives the pictures' size.
    graph
        ``live``, ``live_oneshot``, or a graph of your own that reads a camera.
    params
        The graph's other params, such as ``camera``, ``port`` or ``rate``.
    picture
        "height": grey, black on the film at rest, white from `white_mm` on.  "levels": the 16-bit
        levels of `write_lerobot`, which no video keeps.  "lights": the images of the first three
        LEDs as red, green and blue.
    white_mm
        mm.
    """

    calibration: str
    fps: int | None = 30
    width: int | None = None
    height: int | None = None
    graph: str = "live"
    params: dict[str, Any] = field(default_factory=dict)
    picture: str = "height"
    white_mm: float = 2.0

    def __post_init__(self) -> None:
        if self.picture not in PICTURE_SOURCES:
            raise ValueError(f"picture: {self.picture}: there are {', '.join(PICTURE_SOURCES)}")
        _, rows, columns = calibrated_film(Path(self.calibration)).flat.shape
        if (self.width or columns, self.height or rows) != (columns, rows):
            raise ValueError(
                f"{self.width} x {self.height}: {self.calibration} is for {columns} x {rows} pixels"
            )
        self.width, self.height = columns, rows


class TactographCamera(Camera):  # type: ignore[misc, unused-ignore]
    """A sensor whose stream runs in a thread of its own; the newest picture counts."""

    def __init__(self, config: TactographCameraConfig) -> None:
        super().__init__(config)
        self.config = config
        self._arrival = threading.Condition()
        self._thread: threading.Thread | None = None
        self._ended = threading.Event()
        self._error: Exception | None = None
        self._picture: NDArray[np.uint8] = np.empty((0, 0, PICTURE_CHANNELS), np.uint8)
        self._time = -math.inf
        self._count = self._read = 0

    @property
    def is_connected(self) -> bool:
        """Whether the stream runs."""
        return self._thread is not None and self._thread.is_alive()

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        """Nothing: ``tactograph cameras`` lists them, and a sensor needs its calibration."""
        return []

    def connect(self, warmup: bool = True) -> None:
        """Open the sensor, and wait for its first picture.

        Raises
        ------
        ConnectionError
            If the stream does not begin; with the reason.
        """
        if self.is_connected:
            raise ConnectionError(f"{self}: is connected already")
        self._ended.clear()
        self._error = None
        self._thread = threading.Thread(target=self._run, name=str(self), daemon=True)
        self._thread.start()
        try:
            self.read()
        except (TimeoutError, ConnectionError):
            self.disconnect()
            raise

    def read(self) -> NDArray[Any]:
        """Return the next picture, H x W x 3."""
        with self._arrival:
            self._read = self._count
        return self.async_read(timeout_ms=1000 * START_S)

    def async_read(self, timeout_ms: float = 200) -> NDArray[Any]:
        """Return a picture that was not read before, as soon as there is one.

        Raises
        ------
        TimeoutError
            If none comes in time.
        ConnectionError
            If the stream has ended; with the reason.
        """
        with self._arrival:
            self._arrival.wait_for(
                lambda: self._count > self._read or self._ended.is_set(), timeout_ms / 1000
            )
            if self._count > self._read:
                self._read = self._count
                return self._picture
        self._check()
        raise TimeoutError(f"{self}: no height within {timeout_ms:.0f} ms")

    def read_latest(self, max_age_ms: int = 500) -> NDArray[Any]:
        """Return the newest picture, read before or not.

        Raises
        ------
        TimeoutError
            If it is too old.
        ConnectionError
            If the stream has ended.
        """
        self._check()
        with self._arrival:
            if 1000 * (time.monotonic() - self._time) > max_age_ms:
                raise TimeoutError(f"{self}: no height for {max_age_ms} ms")
            return self._picture

    def disconnect(self) -> None:
        """End the stream, and release the sensor."""
        thread, self._thread = self._thread, None
        self._ended.set()
        if thread is not None:
            thread.join(END_S)

    def __str__(self) -> str:
        return f"tactograph({self.config.calibration})"

    def _check(self) -> None:
        if not self.is_connected:
            reason = f": {self._error}" if self._error else ""
            raise ConnectionError(f"{self}: the stream has ended{reason}") from self._error

    def _run(self) -> None:
        """Show every touch of the stream."""
        config = self.config
        graph = {"format": 1, "extends": config.graph}
        graph["outputs"] = {"picture": PICTURE_SOURCES[config.picture]}
        try:
            params = {"calibration": config.calibration, **config.params}
            with load(graph, params, outputs=["picture"]) as pipeline:
                for touch in pipeline.items():
                    if self._ended.is_set():
                        break
                    picture = self._drawn(touch["picture"])
                    with self._arrival:
                        self._picture, self._time = picture, time.monotonic()
                        self._count += 1
                        self._arrival.notify_all()
        except Exception as error:  # raised for whoever reads next
            self._error = error
        finally:
            with self._arrival:
                self._ended.set()
                self._arrival.notify_all()

    def _drawn(self, value: NDArray[Any]) -> NDArray[np.uint8]:
        if self.config.picture == "lights":
            return lights_picture(value[:PICTURE_CHANNELS])
        if self.config.picture == "levels":
            return levels_picture(height_levels(value))
        grey = np.clip(value * (MAX_BYTE / self.config.white_mm), 0, MAX_BYTE).astype(np.uint8)
        return np.repeat(grey[..., None], PICTURE_CHANNELS, axis=-1)
