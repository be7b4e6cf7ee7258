"""Open a camera, and fix its size, rate, exposure, gain and white balance."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol, cast

# Seconds that V4L2 waits for a frame of a camera that has stopped; OpenCV's default of 10 would
# keep the thread from reopening it.  OpenCV reads the variable at the first wait.
os.environ.setdefault("OPENCV_VIDEOIO_V4L_SELECT_TIMEOUT", "1")

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.rings.live.nodes.camera._camera_names import DEVICE_FILE, GENICAM_PREFIX, device_of
from tactograph.rings.live.nodes.camera._genicam_camera import GenicamCapture, check_genicam
from tactograph.rings.live.nodes.camera._linux_camera import LinuxCapture, linuxpy
from tactograph.rings.live.nodes.camera.sensor_preset import DriverSettings
from tactograph.sdk import InputError

Library = Literal["opencv", "linuxpy"]
Plane = NDArray[np.uint8] | NDArray[np.uint16]

NETWORK_TIMEOUTS_MS = (cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, 1000, cv2.CAP_PROP_READ_TIMEOUT_MSEC, 1000)
"""OpenCV's defaults are half a minute."""
FILE_BACKENDS = ("FFMPEG", "CV_MJPEG", "CV_IMAGES", "GSTREAMER")
"""Back ends for files or network streams, which have no exposure to set."""


class Capture(Protocol):
    """The used part of ``cv2.VideoCapture``: any object with it can be the camera."""

    def isOpened(self) -> bool: ...  # noqa: N802
    def grab(self) -> bool: ...
    def retrieve(self) -> tuple[bool, Any]: ...
    def get(self, prop: int) -> float: ...
    def set(self, prop: int, value: float) -> bool: ...
    def getBackendName(self) -> str: ...  # noqa: N802
    def release(self) -> None: ...


@dataclass(frozen=True)
class View:
    """The part of the camera's picture that shows the film, and the size it is scaled to.

    Parameters
    ----------
    turn_deg : counter-clockwise: 0, 90, 180 or 270
    crop : left, top, right and bottom as shares of the rotated picture
    size : width and height of the frames
    """

    turn_deg: int
    crop: tuple[float, float, float, float]
    size: tuple[int, int]

    def of(self, picture: Plane) -> Plane:
        """Rotate, crop and scale a picture, H x W or H x W x 3."""
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


class CameraSettings(DriverSettings):
    """The settings to request from the camera, and what is made of its pictures.

    Frames in `colour` are H x W x 3 as the driver delivers them, else H x W.  A `view` is applied
    to the camera's pictures.
    """

    colour: bool = False
    view: View | None = None


def open_capture(
    camera: int | str, library: Library = "opencv", *, colour: bool = False
) -> Capture:
    """Open a camera by index, serial number, path or URL; check `isOpened` of the result."""
    if str(camera).startswith(GENICAM_PREFIX):
        return GenicamCapture(str(camera), colour=colour)
    try:
        text = device_of(str(camera))
    except InputError:
        return cv2.VideoCapture()  # it is unplugged
    if library == "linuxpy":
        return LinuxCapture(f"/dev/video{text}" if text.isdecimal() else text, colour=colour)
    # A camera that cannot be opened is reported once, by us.
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    node = DEVICE_FILE.fullmatch(text)
    if node:
        return cv2.VideoCapture(int(node[1]), cv2.CAP_V4L2)
    if text.isdecimal():
        return cv2.VideoCapture(int(text))
    if "://" in text:
        return cv2.VideoCapture(text, cv2.CAP_FFMPEG, list(NETWORK_TIMEOUTS_MS))
    return cv2.VideoCapture(text)


def settle(capture: Capture, settings: CameraSettings) -> list[str]:
    """Fix size, rate, exposure, gain and white balance; return the settings that the driver
    refused.

    With automatic exposure or gain, the light of one LED would depend on that of the others, and
    nothing could be measured.
    """
    backend = capture.getBackendName()
    if backend in FILE_BACKENDS:
        return []
    # Manual is 1 in V4L2's menu, a quarter elsewhere.
    manual = 1.0 if backend in ("V4L2", "V4L") else 0.25
    automatic = [
        (cv2.CAP_PROP_AUTO_EXPOSURE, manual, "automatic exposure off", True),
        (cv2.CAP_PROP_AUTO_WB, 0.0, "automatic white balance off", settings.colour),
        (cv2.CAP_PROP_AUTOFOCUS, 0.0, "automatic focus off", False),
    ]
    code = None if settings.format is None else float(cv2.VideoWriter.fourcc(*settings.format))
    chosen = [
        (cv2.CAP_PROP_FOURCC, code, "pixel format", False),
        (cv2.CAP_PROP_FRAME_WIDTH, settings.width, "width", True),
        (cv2.CAP_PROP_FRAME_HEIGHT, settings.height, "height", True),
        (cv2.CAP_PROP_FPS, settings.rate, "frames per second", True),
        (cv2.CAP_PROP_EXPOSURE, settings.exposure, "exposure", True),
        (cv2.CAP_PROP_GAIN, settings.gain, "gain", True),
        (cv2.CAP_PROP_WB_TEMPERATURE, settings.white_balance, "white balance", True),
    ]
    if backend == "SIMULATED":
        automatic = []
    refused = []
    for prop, value, name, matters in automatic + chosen:
        if value is None:
            continue
        capture.set(prop, float(value))
        actual = capture.get(prop)
        if matters and abs(actual - value) > 0.02 * max(abs(value), 1):
            refused.append(f"the camera keeps {name} at {actual:g} instead of {value:g}")
    return refused


def check_camera(camera: int | str, library: Library = "opencv") -> bool:
    """Tell if `camera` is a file; refuse a path to nothing.

    Raises
    ------
    InputError
        If it looks like a path but nothing is there, no camera has its serial number, or the
        library is not installed.
    """
    if str(camera).startswith(GENICAM_PREFIX):
        check_genicam(str(camera))
        return False
    if library == "linuxpy":
        linuxpy()
    text = device_of(str(camera))
    if text.isdecimal() or "://" in text or text.startswith("/dev/"):
        return False
    if not Path(text).is_file():
        raise InputError(
            f"`camera`={text}: there is no such file; give an index, serial:..., genicam:..., a "
            "path, a URL or 'simulated'"
        )
    return True
