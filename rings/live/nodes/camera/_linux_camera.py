"""A camera read through the kernel (V4L2) by linuxpy, with the interface of ``cv2.VideoCapture``.

Frames have the kernel's time and number, so lost frames are known, not guessed, and grey cameras
deliver all of their 10 to 16 bits.  linuxpy is GPL-3.0; nothing else here needs it.
"""

import importlib
import struct
from contextlib import suppress
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tactograph.rings.frames.colour_planes import in_16_bits
from tactograph.sdk import need

BUFFER_COUNT = 4
WAIT_S = 1.0
"""Time without a frame after which the camera counts as lost."""
COLOUR_FORMATS = ("MJPG", "YUYV", "BGR3", "RGB3")
GREY_FORMATS = ("Y16 ", "Y12 ", "Y10 ", "GREY", "YUYV", "MJPG")
"""Preferred pixel formats, in order, if none is requested."""
FORMAT_BITS = {"Y10 ": 10, "Y12 ": 12, "Y16 ": 16}
CONTROL_NAMES = {
    cv2.CAP_PROP_AUTO_EXPOSURE: 0x009A0901,
    cv2.CAP_PROP_EXPOSURE: 0x009A0902,
    cv2.CAP_PROP_AUTOFOCUS: 0x009A090C,
    cv2.CAP_PROP_AUTO_WB: 0x0098090C,
    cv2.CAP_PROP_GAIN: 0x00980913,
    cv2.CAP_PROP_WB_TEMPERATURE: 0x0098091A,
}
"""The V4L2 control for each of OpenCV's properties."""


def linuxpy() -> Any:
    """linuxpy's module of video devices.

    Raises
    ------
    InputError
        If it is not installed.
    """
    need("linux", "linuxpy", "linuxpy")
    return importlib.import_module("linuxpy.video.device")


class LinuxCapture:
    """The used part of ``cv2.VideoCapture``, for ``/dev/videoN``.

    Parameters
    ----------
    device : the device node
    colour : whether to deliver colour pictures

    Attributes
    ----------
    sequence : the kernel's number of the last frame; a gap means lost frames
    """

    def __init__(self, device: str, *, colour: bool) -> None:
        video = linuxpy()
        self._error: type[Exception] = video.V4L2Error
        self._preferred = COLOUR_FORMATS if colour else GREY_FORMATS
        self._requested: dict[int, float] = {}
        self._streaming = False
        self._picture: NDArray[Any] | None = None
        self._moment = 0.0
        self.sequence = -1
        self._device = video.Device(device)
        self._source = video.VideoCapture(self._device, size=BUFFER_COUNT)
        try:
            self._device.open()
            self._formats = [_name(each.pixel_format) for each in self._source.formats()]
        except OSError:
            self._device.close()

    def isOpened(self) -> bool:  # noqa: N802  (OpenCV's names)
        """Tell if frames can be expected."""
        return not self._device.closed

    def getBackendName(self) -> str:  # noqa: N802
        """OpenCV's name of this interface, because manual exposure has the same value."""
        return "V4L2"

    def release(self) -> None:
        """End the stream and close the camera."""
        # An unplugged camera cannot be closed properly.
        with suppress(OSError):
            self._source.close()
        self._device.close()

    def set(self, prop: int, value: float) -> bool:
        """Request a size, a rate, a pixel format, or a control's value."""
        if prop in CONTROL_NAMES:
            return self._control(prop, value)
        self._requested[prop] = value
        return True

    def get(self, prop: int) -> float:
        """A requested value, a control's value, or the last frame's time in ms."""
        if prop == cv2.CAP_PROP_POS_MSEC:
            return 1e3 * self._moment
        if prop in CONTROL_NAMES:
            try:
                return float(self._device.controls[CONTROL_NAMES[prop]].value)
            except (KeyError, OSError, TypeError):
                return -1.0
        return self._requested.get(prop, 0.0)

    def grab(self) -> bool:
        """Wait for the next complete frame; False if the camera is gone."""
        try:
            if not self._streaming:
                self._start()
            while True:
                if not self._device.io.select.select((self._device,), (), (), WAIT_S)[0]:
                    return False
                frame = self._source.buffer.raw_read()
                self.sequence, self._moment = frame.frame_nb, frame.timestamp
                self._picture = self._decoded(frame.data)
                if self._picture is not None:
                    return True
        except (OSError, ValueError, self._error):
            return False

    def retrieve(self) -> tuple[bool, NDArray[Any] | None]:
        """The frame that `grab` took: H x W, 8 or 16 bit, or H x W x 3 in blue, green, red."""
        return self._picture is not None, self._picture

    def _control(self, prop: int, value: float) -> bool:
        try:
            self._device.controls[CONTROL_NAMES[prop]].value = round(value)
        except (KeyError, OSError, AttributeError, ValueError):
            return False
        return True

    def _start(self) -> None:
        current = self._source.get_format()
        width = int(self._requested.get(cv2.CAP_PROP_FRAME_WIDTH, current.width))
        height = int(self._requested.get(cv2.CAP_PROP_FRAME_HEIGHT, current.height))
        self._source.set_format(width, height, self._format())
        rate = self._requested.get(cv2.CAP_PROP_FPS)
        if rate:
            # Some cameras have only one rate.
            with suppress(OSError):
                self._source.set_fps(rate)
        self._source.open()
        self._streaming = True

    def _format(self) -> str:
        """The requested pixel format, else the camera's best one."""
        code = self._requested.get(cv2.CAP_PROP_FOURCC)
        if code:
            return struct.pack("<I", int(code)).decode("ascii")
        formats = [each for each in self._preferred if each in self._formats]
        if not formats:
            raise ValueError("no format that can be read")
        return formats[0]

    def _decoded(self, data: bytes) -> NDArray[Any] | None:
        """The picture of a frame's bytes; None if it is damaged."""
        kind = self._source.buffer.format
        return decode(data, _name(kind.pixel_format), kind.width, kind.height, kind.bytes_per_line)


def decode(data: bytes, name: str, width: int, height: int, stride: int) -> NDArray[Any] | None:
    """Convert a frame's bytes to a picture; None if they are incomplete or damaged.

    Parameters
    ----------
    data : bytes from the kernel
    name : the pixel format's four letters
    width, height : of the picture
    stride : bytes per row, including unused ones after its pixels

    Returns
    -------
    H x W x 3 (blue, green, red), H x W of 8 bit, or H x W of 16 bit, of which 10 or 12 are
    spread over all 16, so that full scale is full scale.
    """
    raw = np.frombuffer(data, np.uint8)
    if name in ("MJPG", "JPEG"):
        return cv2.imdecode(raw, cv2.IMREAD_COLOR) if raw.size else None
    size = {"GREY": 1, "YUYV": 2, "BGR3": 3, "RGB3": 3}.get(name, 2)
    stride = max(stride, width * size)
    if raw.size < height * stride:
        return None
    rows = np.ascontiguousarray(raw[: height * stride].reshape(height, stride)[:, : width * size])
    if name in FORMAT_BITS:
        return in_16_bits(rows.view("<u2").astype(np.uint16), FORMAT_BITS[name])
    planes = rows.reshape(height, width, size)
    if name == "GREY":
        return planes[..., 0]
    if name == "YUYV":
        return cv2.cvtColor(planes, cv2.COLOR_YUV2BGR_YUY2)
    return np.ascontiguousarray(planes[..., ::-1]) if name == "RGB3" else planes


def _name(pixel_format: Any) -> str:
    return struct.pack("<I", int(pixel_format)).decode("ascii", "replace")
