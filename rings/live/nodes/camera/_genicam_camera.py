"""Industrial cameras (GenICam) through harvesters, with the interface of ``cv2.VideoCapture``.

The camera's maker provides a GenTL producer, a ``.cti`` file; the variable GENICAM_GENTL64_PATH
names the folders of such files.  A process loads each of them only once, so all cameras share
one Harvester.
"""

import importlib
import os
import re
import signal
import threading
import time
import warnings
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.rings.frames.colour_planes import in_16_bits
from tactograph.rings.live.nodes.camera._camera_names import (
    GENICAM_PREFIX,
    NamedCamera,
    no_such_camera,
)
from tactograph.sdk import InputError, need

PRODUCER_VARIABLE = "GENICAM_GENTL64_PATH"
WAIT_S = 1.0
"""Time without a frame after which the camera counts as lost."""
CLOCK_FRAMES = 128
"""Frames over which the camera's clock is compared with the host's; their drift is negligible."""
PIXEL_FORMAT = re.compile(r"(Mono|Bayer(?:RG|GR|GB|BG)|(?:RGB|BGR)a?)(8|10|12|14|16)")
"""The supported pixel formats: PFNC names, without packed formats."""
COLOUR_FORMATS = ("BayerRG8", "BayerGR8", "BayerGB8", "BayerBG8", "RGB8", "BGR8", "RGBa8", "BGRa8")
GREY_FORMATS = ("Mono16", "Mono14", "Mono12", "Mono10", "Mono8")
"""Preferred formats, in order, for a camera that is not set to a suitable one."""
FEATURE_NAMES = {
    cv2.CAP_PROP_FRAME_WIDTH: "Width",
    cv2.CAP_PROP_FRAME_HEIGHT: "Height",
    cv2.CAP_PROP_FPS: "AcquisitionFrameRate",
    cv2.CAP_PROP_EXPOSURE: "ExposureTime",
    cv2.CAP_PROP_GAIN: "Gain",
}
"""The standard's feature for each of OpenCV's properties; exposure is in microseconds."""
AUTOMATIC_FEATURES = {
    cv2.CAP_PROP_AUTO_EXPOSURE: (0.25, ("ExposureAuto", "GainAuto")),
    cv2.CAP_PROP_AUTO_WB: (0.0, ("BalanceWhiteAuto",)),
}
"""What OpenCV calls off, and the features that are then off."""
# Named by the first row's two pixels, as in GenICam; OpenCV has aliases of all four.
BAYER_CODES = {
    "BayerRG": cv2.COLOR_BayerRGGB2BGR,
    "BayerGR": cv2.COLOR_BayerGRBG2BGR,
    "BayerGB": cv2.COLOR_BayerGBRG2BGR,
    "BayerBG": cv2.COLOR_BayerBGGR2BGR,
}

_lock = threading.RLock()
_shared: list[Any] = []
"""The process's Harvester, once there is one."""


def genicam_cameras() -> list[NamedCamera]:
    """The cameras that the producers find.

    Raises
    ------
    InputError
        If harvesters is not installed, or there is no producer.
    """
    with _lock:
        devices = _updated().device_info_list
        names = [(f"{each.vendor} {each.model}", str(each.serial_number)) for each in devices]
    return [NamedCamera(GENICAM_PREFIX + serial, name, serial) for name, serial in names]


def check_genicam(camera: str) -> None:
    """Check that a camera exists, can be opened, and has a supported pixel format.

    Raises
    ------
    InputError
        If it does not, or harvesters or producers are missing.
    """
    cameras = genicam_cameras()
    if camera not in {each.device for each in cameras}:
        raise no_such_camera(camera, cameras)
    capture = GenicamCapture(camera, colour=False)
    try:
        formats = capture.formats
        if not capture.isOpened():
            raise InputError(f"`camera`={camera}: cannot be opened: {capture.reason}")
        if not any(PIXEL_FORMAT.fullmatch(each) for each in formats):
            raise InputError(
                f"`camera`={camera}: its pixels are {', '.join(formats)}; Mono, Bayer or RGB of 8 "
                "to 16 bits, not packed, can be read"
            )
    finally:
        capture.release()


class GenicamCapture:
    """The used part of ``cv2.VideoCapture``, for a GenICam camera.

    Parameters
    ----------
    camera : ``genicam:`` and the serial number
    colour : whether to deliver colour pictures

    Attributes
    ----------
    sequence : the number of the last frame; a gap means lost frames
    reason : why the camera could not be opened
    """

    def __init__(self, camera: str, *, colour: bool) -> None:
        self.sequence = -1
        self.reason = ""
        self._preferred = COLOUR_FORMATS if colour else GREY_FORMATS
        self._colour = colour
        self._streaming = False
        self._picture: NDArray[Any] | None = None
        self._clock = _Clock()
        self._moment = 0.0
        self._acquirer: Any = None
        try:
            with _lock:
                self._acquirer = _created(_updated(), camera.removeprefix(GENICAM_PREFIX))
        except _errors(ValueError) as error:
            self.reason = " ".join(str(error).split())

    @property
    def formats(self) -> list[str]:
        """The names of the camera's pixel formats."""
        node = self._feature("PixelFormat")
        return [] if node is None else [str(each) for each in node.symbolics]

    def isOpened(self) -> bool:  # noqa: N802  (OpenCV's names)
        """Tell if frames can be expected."""
        return self._acquirer is not None

    def getBackendName(self) -> str:  # noqa: N802
        """A name that no back end of OpenCV has."""
        return "GENICAM"

    def release(self) -> None:
        """End the stream and close the camera."""
        acquirer, self._acquirer = self._acquirer, None
        if acquirer is None:
            return
        # An unplugged camera cannot be closed properly.
        with _lock, suppress(*_errors()):
            if self._streaming:
                acquirer.stop()
            acquirer.destroy()

    def set(self, prop: int, value: float) -> bool:
        """Set a feature, or turn automatic ones off."""
        if prop in AUTOMATIC_FEATURES:
            for name in AUTOMATIC_FEATURES[prop][1]:
                self._write(name, "Off")
            return self.get(prop) == value
        if prop == cv2.CAP_PROP_FPS:
            self._write("AcquisitionFrameRateEnable", True)
        whole = prop in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
        return prop in FEATURE_NAMES and self._write(
            FEATURE_NAMES[prop], int(value) if whole else value
        )

    def get(self, prop: int) -> float:
        """A feature's value, or the last frame's time in ms; -1 if the camera lacks the feature."""
        if prop == cv2.CAP_PROP_POS_MSEC:
            return 1e3 * self._moment
        if prop in AUTOMATIC_FEATURES:
            off, names = AUTOMATIC_FEATURES[prop]
            states = [self._feature(name) for name in names]
            return off if all(node is None or node.value == "Off" for node in states) else -1.0
        node = self._feature(FEATURE_NAMES[prop]) if prop in FEATURE_NAMES else None
        return -1.0 if node is None else float(node.value)

    def grab(self) -> bool:
        """Wait for the next complete frame; False if the camera is gone."""
        try:
            if not self._streaming:
                self._start()
            until = time.monotonic() + WAIT_S
            while time.monotonic() < until:
                buffer = self._acquirer.try_fetch(timeout=WAIT_S)
                if buffer is not None and self._take(buffer):
                    return True
        # The camera may have been closed in another thread.
        except _errors(ValueError, AttributeError, IndexError):
            return False
        return False

    def retrieve(self) -> tuple[bool, NDArray[Any] | None]:
        """The frame that `grab` took: H x W, 8 or 16 bit, or H x W x 3 in blue, green, red."""
        return self._picture is not None, self._picture

    def _start(self) -> None:
        feature = self._feature("PixelFormat")
        name = "" if feature is None else str(feature.value)
        is_grey, is_known = name.startswith("Mono"), PIXEL_FORMAT.fullmatch(name) is not None
        suitable = [each for each in self._preferred if each in self.formats]
        if feature is not None and suitable and (not is_known or is_grey == self._colour):
            feature.value = suitable[0]
        self._acquirer.start()
        self._streaming = True

    def _take(self, buffer: Any) -> bool:
        arrival_s = time.monotonic()
        with buffer:
            image = buffer.payload.components[0]
            self._picture = decode(
                image.data, image.data_format, image.width, image.height, image.x_padding
            )
            self.sequence = int(buffer.module.frame_id)
            self._moment = self._clock.host(_stamp(buffer), arrival_s)
        return self._picture is not None

    def _feature(self, name: str) -> Any:
        """A feature that is readable now; None if the camera does not have it."""
        try:
            node = getattr(self._acquirer.remote_device.node_map, name)
            _ = node.value
        except _errors(AttributeError):
            return None
        return node

    def _write(self, name: str, value: Any) -> bool:
        node = self._feature(name)
        if node is None:
            return False
        try:
            node.value = value
        except _errors():
            return False
        return True


class _Clock:
    """Converts the camera's clock to the host's, by the frame with the fastest transfer.

    The shortest transfer time remains in the result; its jitter does not.
    """

    def __init__(self) -> None:
        self._apart: deque[float] = deque(maxlen=CLOCK_FRAMES)

    def host(self, stamp: float | None, arrival_s: float) -> float:
        """The frame's time on the host's clock; its arrival if the camera gives no time."""
        if stamp is None:
            return arrival_s
        self._apart.append(arrival_s - stamp)
        return stamp + min(self._apart)


def decode(
    data: NDArray[Any], name: str, width: int, height: int, padding: int = 0
) -> NDArray[Any] | None:
    """Convert a frame's elements to a picture; None if they are incomplete or unsupported.

    Parameters
    ----------
    data : elements from harvesters: 8 or 16 bit, row by row
    name : the pixel format's name
    width, height : of the picture
    padding : unused elements at the end of each row

    Returns
    -------
    H x W, or H x W x 3 (blue, green, red), 8 or 16 bit; 10 to 14 bits are spread over all 16,
    so that full scale is full scale.
    """
    kind = PIXEL_FORMAT.fullmatch(name)
    if kind is None:
        return None
    layout, bits = kind[1], int(kind[2])
    channels = {"RGB": 3, "BGR": 3, "RGBa": 4, "BGRa": 4}.get(layout, 1)
    row = width * channels + padding
    if row * height == 0 or data.size < row * height:
        return None
    values = data[: row * height].reshape(height, row)[:, : width * channels].copy()
    if bits in (10, 12, 14):
        values = in_16_bits(values, bits)
    if layout in BAYER_CODES:
        return cv2.cvtColor(values, BAYER_CODES[layout])
    if channels == 1:
        return values
    picture = values.reshape(height, width, channels)[..., :3]
    return np.ascontiguousarray(picture[..., ::-1] if layout.startswith("RGB") else picture)


def _stamp(buffer: Any) -> float | None:
    """The frame's time on the camera's clock in s; None if the camera gives none."""
    try:
        return float(buffer.timestamp) / float(buffer.timestamp_frequency) or None
    # If a producer knows no frequency, harvesters itself raises an attribute error.
    except _errors(AttributeError, ZeroDivisionError):
        return None


def _updated() -> Any:
    """The process's Harvester; it updates only while no camera is open, because that closes it."""
    if not _shared:
        need("genicam", "a GenICam camera", "harvesters")
        with warnings.catch_warnings():  # its import lets every warning through
            harvester = importlib.import_module("harvesters.core").Harvester()
        for file in _producers():
            harvester.add_file(str(file))
        _shared.append(harvester)
    (harvester,) = _shared
    if not harvester.image_acquirers:
        harvester.update()
    return harvester


def _created(harvester: Any, serial: str) -> Any:
    main = threading.current_thread() is threading.main_thread()
    before = signal.getsignal(signal.SIGINT)
    try:
        return harvester.create({"serial_number": serial})
    finally:
        if main:
            # Harvesters takes over Ctrl-C, which belongs to the pipeline.
            signal.signal(signal.SIGINT, before)


def _producers() -> list[Path]:
    folders = filter(None, os.environ.get(PRODUCER_VARIABLE, "").split(os.pathsep))
    producers = [file for folder in folders for file in sorted(Path(folder).glob("*.cti"))]
    if not producers:
        raise InputError(
            f"GenICam cameras need their maker's GenTL producer: {PRODUCER_VARIABLE} names no "
            "folder with a .cti file"
        )
    return producers


def _errors(*others: type[Exception]) -> tuple[type[Exception], ...]:
    """The errors that producers and cameras raise, and `others`."""
    try:
        gentl, genapi = (importlib.import_module(f"genicam.{name}") for name in ("gentl", "genapi"))
    except ImportError:
        return (OSError, *others)
    return (gentl.GenericException, genapi.GenericException, OSError, *others)
