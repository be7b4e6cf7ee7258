"""A camera driver made of software: it answers the kernel's calls that linuxpy makes.

linuxpy itself runs as it is, on a plain file in place of ``/dev/video0``.
"""

import mmap
import time
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
import pytest

video = pytest.importorskip("linuxpy.video.device", reason="linuxpy is not installed")
raw, IOC = video.raw, video.raw.IOC


class Driver:
    """One camera: the pixel formats it has, its frames, and what was asked of it.

    Attributes
    ----------
    frames
        Bytes of the frames to come, or a number of frames that are lost.
    controls
        By V4L2's number.
    node
        The path at which it is plugged in.
    """

    node = ""

    def __init__(self, formats: tuple[str, ...], size: tuple[int, int], stride: int = 0) -> None:
        self.formats, self.size, self.stride = formats, size, stride
        self.format, self.rate = formats[0], 0.0
        self.frames: deque[bytes | int] = deque()
        self.controls = {0x009A0901: 3, 0x009A0902: 100, 0x00980913: 5}
        self.sequence = -1
        self.stamps: list[float] = []
        self.streaming = False
        self._queue: deque[int] = deque()
        self._memory: dict[int, mmap.mmap] = {}

    def ioctl(self, fd: Any, request: Any, arg: Any = 0) -> Any:
        answer = getattr(self, f"_{IOC(request).name.lower()}", None)
        if answer is None:
            raise OSError(25, "Inappropriate ioctl for device")
        answer(arg)
        return arg

    def map_memory(self, fd: Any, length: int, offset: int) -> mmap.mmap:
        self._memory[offset // 2**20] = mmap.mmap(-1, length)
        return self._memory[offset // 2**20]

    def _querycap(self, caps: Any) -> None:
        caps.driver, caps.card = b"fake", b"A Sensor"
        caps.capabilities = caps.device_caps = (
            video.Capability.VIDEO_CAPTURE | video.Capability.STREAMING
        )

    def _enum_fmt(self, each: Any) -> None:
        if each.index >= len(self.formats):
            raise OSError(22, "Invalid argument")
        each.pixelformat = raw.v4l2_fourcc(*self.formats[each.index])

    def _enum_framesizes(self, each: Any) -> None:
        if each.index:
            raise OSError(22, "Invalid argument")
        each.type = 1
        each.m1.discrete.width, each.m1.discrete.height = self.size

    def _enum_frameintervals(self, each: Any) -> None:
        if each.index:
            raise OSError(22, "Invalid argument")
        each.type = 1
        each.discrete.numerator, each.discrete.denominator = 1, 30

    def _s_fmt(self, fmt: Any) -> None:
        pixel = fmt.fmt.pix
        self.format = int(pixel.pixelformat).to_bytes(4, "little").decode()
        self._g_fmt(fmt)

    def _g_fmt(self, fmt: Any) -> None:
        pixel = fmt.fmt.pix
        pixel.width, pixel.height = self.size
        pixel.pixelformat = raw.v4l2_fourcc(*self.format)
        pixel.bytesperline, pixel.sizeimage = self.stride, 2**18

    def _s_parm(self, parm: Any) -> None:
        each = parm.parm.capture.timeperframe
        self.rate = each.denominator / each.numerator

    def _reqbufs(self, wanted: Any) -> None:
        self._queue.clear()

    def _querybuf(self, buffer: Any) -> None:
        buffer.length, buffer.m.offset = 2**18, buffer.index * 2**20

    def _qbuf(self, buffer: Any) -> None:
        self._queue.append(buffer.index)

    def _dqbuf(self, buffer: Any) -> None:
        while self.frames and isinstance(self.frames[0], int):
            self.sequence += int(self.frames.popleft())
        if not self.frames or not self.streaming:
            raise OSError(19, "No such device")
        data = self.frames.popleft()
        assert isinstance(data, bytes)
        self.sequence += 1
        buffer.index = self._queue.popleft()
        self._memory[buffer.index][: len(data)] = data
        buffer.bytesused, buffer.sequence = len(data), self.sequence
        self.stamps.append(time.monotonic())
        buffer.timestamp.set_ns(round(1e9 * self.stamps[-1]))

    def _streamon(self, arg: Any) -> None:
        self.streaming = True

    def _streamoff(self, arg: Any) -> None:
        self.streaming = False

    def _query_ext_ctrl(self, query: Any) -> None:
        after = query.id & 0x0FFFFFFF
        later = sorted(each for each in self.controls if each > after)
        if not later:
            raise OSError(22, "Invalid argument")
        query.id, query.type = later[0], 1
        query.name = b"Control"
        query.minimum, query.maximum, query.step = 0, 10000, 1
        query.elem_size, query.elems = 4, 1

    def _g_ext_ctrls(self, asked: Any) -> None:
        for i in range(asked.count):
            asked.controls[i].value = self.controls[asked.controls[i].id]

    def _s_ext_ctrls(self, asked: Any) -> None:
        for i in range(asked.count):
            self.controls[asked.controls[i].id] = asked.controls[i].value

    def _g_ctrl(self, control: Any) -> None:
        control.value = self.controls[control.id]

    def _s_ctrl(self, control: Any) -> None:
        self.controls[control.id] = control.value


def plug_in(driver: Driver, patch: pytest.MonkeyPatch, folder: Path) -> None:
    """Let linuxpy find the driver behind a file."""
    node = folder / "video0"
    node.touch()
    patch.setattr(video, "ioctl", driver.ioctl)
    patch.setattr(video, "mem_map", driver.map_memory)
    driver.node = str(node)


def picture(rows: int = 12, columns: int = 16) -> np.ndarray:
    """A picture whose colours tell blue from red and left from right."""
    made = np.zeros((rows, columns, 3), np.uint8)
    made[..., 0], made[..., 2] = 200, np.linspace(20, 120, columns)
    return made
