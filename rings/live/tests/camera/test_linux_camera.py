"""A camera through the kernel: its formats, its time, and what was lost on the way."""

import struct
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.rings.live.nodes.camera._linux_camera import LinuxCapture, decode
from tactograph.rings.live.nodes.camera.camera import Camera
from tactograph.rings.live.nodes.camera.list_cameras import _formats
from tactograph.rings.live.nodes.camera.open_camera import CameraSettings, open_capture, settle

if sys.platform != "linux":
    pytest.skip("V4L2 is the Linux kernel's", allow_module_level=True)

from rings.live.tests.camera.fake_v4l2 import Driver, picture, plug_in


def jpeg() -> bytes:
    return cv2.imencode(".jpg", picture(), [cv2.IMWRITE_JPEG_QUALITY, 100])[1].tobytes()


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Driver:
    made = Driver(("YUYV", "MJPG"), (16, 12))
    made.frames.extend([jpeg()] * 3)
    plug_in(made, monkeypatch, tmp_path)
    return made


def test_frames_have_the_kernels_time_and_number(driver: Driver) -> None:
    capture = LinuxCapture(driver.node, colour=True)
    assert capture.isOpened()
    assert capture.grab()
    assert capture.get(cv2.CAP_PROP_POS_MSEC) == pytest.approx(1e3 * driver.stamps[0], abs=0.01)
    assert capture.sequence == 0
    there, found = capture.retrieve()
    assert there
    np.testing.assert_allclose(found, picture(), atol=25)
    capture.release()
    assert not driver.streaming


def test_of_the_formats_the_best_is_taken_or_the_one_asked_for(driver: Driver) -> None:
    LinuxCapture(driver.node, colour=True).grab()
    assert driver.format == "MJPG"
    driver.frames.clear()
    driver.frames.append(np.full((12, 32), 128, np.uint8).tobytes())
    capture = LinuxCapture(driver.node, colour=True)
    capture.set(cv2.CAP_PROP_FOURCC, float(cv2.VideoWriter.fourcc(*"YUYV")))
    assert capture.grab()
    assert driver.format == "YUYV"


def test_size_rate_and_exposure_reach_the_driver(driver: Driver) -> None:
    capture = LinuxCapture(driver.node, colour=True)
    refused = settle(
        capture, CameraSettings(width=16, height=12, rate=25.0, exposure=250, gain=9, colour=True)
    )
    assert capture.grab()
    assert driver.rate == 25
    assert driver.controls[0x009A0901] == 1  # manual
    assert driver.controls[0x009A0902] == 250
    assert driver.controls[0x00980913] == 9
    assert [line for line in refused if "white balance" not in line] == []


def test_formats_sizes_and_rates_are_listed(driver: Driver) -> None:
    assert sorted(_formats(driver.node).splitlines()) == ["MJPEG: 16x12@30", "YUYV: 16x12@30"]


def test_a_damaged_frame_is_passed_over(driver: Driver) -> None:
    driver.frames.appendleft(b"\xff\xd8 no picture")
    capture = LinuxCapture(driver.node, colour=True)
    assert capture.grab()
    assert capture.sequence == 1


def test_an_unplugged_camera_delivers_nothing(driver: Driver) -> None:
    capture = LinuxCapture(driver.node, colour=True)
    assert capture.grab()
    driver.frames.clear()
    assert not capture.grab()
    capture.release()
    assert not capture.isOpened()


def test_lost_frames_are_counted_by_the_kernels_numbers(driver: Driver) -> None:
    driver.frames.extend([4, jpeg()])
    camera = Camera(
        lambda: open_capture(driver.node, "linuxpy", colour=True),
        CameraSettings(width=16, height=12, rate=30.0, colour=True),
    )
    try:
        numbers: list[int] = []
        until = time.monotonic() + 5
        while len(numbers) < 4 and time.monotonic() < until:
            numbers += [shot.number for shot in camera.shots(0.2)]
    finally:
        camera.close()
    assert numbers == [0, 1, 2, 7]
    assert camera.faults["lost"] == 4


def test_without_the_library_one_line_names_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "linuxpy", None)
    with pytest.raises(InputError, match=r"pip install 'tactograph\[linux\]'"):
        LinuxCapture("/dev/video0", colour=True)


@pytest.mark.parametrize("bits", [10, 12, 16])
def test_grey_of_10_to_16_bits_keeps_all_of_them(bits: int) -> None:
    top = 2**bits - 1
    values = np.array([[0, 1, top // 2], [top - 1, top, 7]], "<u2")
    found = decode(values.tobytes(), f"Y{bits} ", 3, 2, 6)
    assert found.dtype == np.uint16
    assert found[1, 1] == 65535
    np.testing.assert_array_equal(found >> (16 - bits), values)


def test_bytes_beyond_a_rows_pixels_are_no_picture_nor_is_half_a_frame() -> None:
    padded = np.full((2, 8), 99, np.uint8)
    padded[:, :3] = [[1, 2, 3], [4, 5, 6]]
    found = decode(padded.tobytes(), "GREY", 3, 2, 8)
    np.testing.assert_array_equal(found, [[1, 2, 3], [4, 5, 6]])
    assert decode(bytes(5), "GREY", 3, 2, 3) is None
    assert decode(b"", "MJPG", 3, 2, 0) is None


def test_red_and_blue_are_not_taken_for_one_another() -> None:
    blue = struct.pack("3B", 0, 0, 200) * 4
    found = decode(blue, "RGB3", 2, 2, 6)
    np.testing.assert_array_equal(found[0, 0], [200, 0, 0])
