"""GenICam cameras: harvesters itself, on the simulated producer that comes with its bindings."""

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.rings.live.nodes.camera import _genicam_camera
from tactograph.rings.live.nodes.camera._genicam_camera import (
    PRODUCER_VARIABLE,
    GenicamCapture,
    _Clock,
    _stamp,
    check_genicam,
    decode,
    genicam_cameras,
)
from tactograph.rings.live.nodes.camera.camera import Camera
from tactograph.rings.live.nodes.camera.list_cameras import list_cameras
from tactograph.rings.live.nodes.camera.open_camera import (
    CameraSettings,
    check_camera,
    open_capture,
    settle,
)

genicam = pytest.importorskip("genicam", reason="harvesters is not installed")
SIMULATED = Path(genicam.__file__).with_name("viky.cti")
RED, GREEN = "genicam:0", "genicam:1"
pytestmark = pytest.mark.usefixtures("producer")


@pytest.fixture
def producer(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Three simulated cameras, of RGBa8 or Mono8, 100 to 800 pixels wide."""
    monkeypatch.setenv(PRODUCER_VARIABLE, str(SIMULATED.parent))
    monkeypatch.setattr(_genicam_camera, "_shared", [])
    yield
    for harvester in _genicam_camera._shared:
        harvester.reset()


def test_cameras_are_listed_with_serial_and_formats(capsys: pytest.CaptureFixture[str]) -> None:
    assert [each.device for each in genicam_cameras()] == [RED, GREEN, "genicam:2"]
    list_cameras()
    printed = capsys.readouterr().out
    assert "genicam:1" in printed
    assert "RGBa8 Mono8: 400x400" in printed


def test_size_and_rate_reach_the_camera_and_frames_are_counted() -> None:
    capture = open_capture(RED)
    refused = settle(capture, CameraSettings(width=320, height=240, rate=50.0))
    assert refused == []
    began, numbers = time.monotonic(), []
    for _ in range(10):
        assert capture.grab()
        numbers.append(capture.sequence)  # type: ignore[attr-defined]
    spent = time.monotonic() - began
    there, picture = capture.retrieve()
    capture.release()
    assert there
    assert (picture.shape, picture.dtype) == ((240, 320), np.uint8)
    assert np.diff(numbers).min() >= 1
    assert spent > 0.1
    assert not capture.isOpened()


def test_a_colour_picture_is_blue_green_red() -> None:
    capture = GenicamCapture(RED, colour=True)
    assert capture.grab()
    _, picture = capture.retrieve()
    capture.release()
    assert picture.shape == (400, 400, 3)
    # A red ball on white.
    coloured = picture[np.ptp(picture, axis=-1) > 100]
    assert len(coloured)
    assert coloured.mean(axis=0).argmax() == 2


def test_a_format_that_cannot_be_read_gives_way_to_the_best_that_can() -> None:
    capture = GenicamCapture(GREEN, colour=False)
    assert capture._feature("PixelFormat").value == "RGBa8"
    assert capture.grab()
    assert capture._feature("PixelFormat").value == "Mono8"
    capture.release()


def test_two_cameras_run_side_by_side_and_one_is_opened_again() -> None:
    first, second = (GenicamCapture(each, colour=False) for each in (RED, GREEN))
    assert first.grab()
    assert second.grab()
    first.release()
    assert second.grab()
    again = GenicamCapture(RED, colour=False)
    assert again.grab()
    assert second.grab()
    again.release()
    second.release()


def test_its_frames_come_through_the_cameras_thread() -> None:
    wanted = CameraSettings(width=200, height=100, rate=100.0)
    camera = Camera(lambda: open_capture(RED), wanted)
    try:
        camera.check(5.0, RED)
        shots, until = [], time.monotonic() + 10
        while len(shots) < 5 and time.monotonic() < until:
            shots += camera.shots(0.2)
    finally:
        camera.close()
    assert len(shots) >= 5
    assert shots[0].data.shape == (100, 200)
    assert np.diff([shot.time for shot in shots]).min() > 0


def test_ctrl_c_stays_the_pipelines() -> None:
    before = signal.getsignal(signal.SIGINT)
    GenicamCapture(RED, colour=False).release()
    assert signal.getsignal(signal.SIGINT) is before


def test_the_librarys_own_warnings_stay_with_it() -> None:
    program = (
        "import warnings\n"
        "from tactograph.rings.live.nodes.camera._genicam_camera import genicam_cameras\n"
        "genicam_cameras(); print('once' in [kind for kind, *_ in warnings.filters])"
    )
    assert subprocess.check_output([sys.executable, "-c", program], text=True) == "False\n"


def test_an_unknown_serial_number_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"genicam:7: no camera has .* 0 \(Machine Vision"):
        check_camera("genicam:7")
    assert not open_capture("genicam:7").isOpened()


def test_unreadable_pixel_formats_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(GenicamCapture, "formats", ["Mono12p", "YUV422_8"])
    with pytest.raises(InputError, match="its pixels are Mono12p, YUV422_8"):
        check_genicam(RED)


def test_a_camera_in_use_by_another_program_is_refused_with_the_reason() -> None:
    mine = GenicamCapture(RED, colour=False)
    with pytest.raises(InputError, match="genicam:0: cannot be opened: ") as error:
        check_genicam(RED)
    mine.release()
    assert "\n" not in str(error.value)


def test_without_a_producer_or_the_library_one_line_names_the_cure(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv(PRODUCER_VARIABLE, str(tmp_path))
    with pytest.raises(InputError, match="GENICAM_GENTL64_PATH names no folder"):
        check_camera(RED)
    monkeypatch.setitem(sys.modules, "harvesters", None)
    with pytest.raises(InputError, match=r"pip install 'tactograph\[genicam\]'"):
        check_camera(RED)


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
def test_grey_of_10_to_16_bits_keeps_all_of_them(bits: int) -> None:
    top = 2**bits - 1
    values = np.array([0, 1, top // 2, top - 1, top, 7], "<u2")
    found = decode(values, f"Mono{bits}", 3, 2)
    assert (found.dtype, found[1, 1]) == (np.uint16, 65535)
    np.testing.assert_array_equal(found.ravel() >> (16 - bits), values)


@pytest.mark.parametrize(
    ("name", "place"),
    [("BayerRG8", (0, 0)), ("BayerGR8", (0, 1)), ("BayerGB8", (1, 0)), ("BayerBG8", (1, 1))],
)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_mosaics_red_pixels_are_red(name: str, place: tuple[int, int], dtype: type) -> None:
    """`place` is where the first red pixel lies."""
    mosaic, top = np.zeros((8, 10), dtype), np.iinfo(dtype).max
    mosaic[place[0] :: 2, place[1] :: 2] = top
    wide = name if dtype is np.uint8 else name.replace("8", "16")
    found = decode(mosaic.ravel(), wide, 10, 8)
    assert found.dtype == dtype
    assert found[2:-2, 2:-2, 2].min() > 0.9 * top
    assert found[2:-2, 2:-2, :2].max() == 0


@pytest.mark.parametrize(
    ("name", "data"), [("RGB8", [1, 2, 3]), ("BGR8", [3, 2, 1]), ("RGBa8", [1, 2, 3, 255])]
)
def test_red_and_blue_are_not_taken_for_one_another(name: str, data: list[int]) -> None:
    found = decode(np.array(data * 4, np.uint8), name, 2, 2)
    np.testing.assert_array_equal(found[1, 1], [3, 2, 1])


def test_elements_beyond_a_rows_pixels_are_no_picture() -> None:
    data = np.array([1, 2, 3, 99, 4, 5, 6, 99], np.uint8)
    np.testing.assert_array_equal(decode(data, "Mono8", 3, 2, 1), [[1, 2, 3], [4, 5, 6]])


@pytest.mark.parametrize("name", ["Mono12p", "Mono12Packed", "YUV422_8", "Coord3D_C16"])
def test_other_pixels_and_half_a_frame_are_no_picture(name: str) -> None:
    assert decode(np.zeros(64, np.uint8), name, 4, 4) is None
    assert decode(np.zeros(5, np.uint8), "Mono8", 3, 2) is None


def test_the_jitter_of_a_transfer_is_taken_out_by_the_cameras_clock() -> None:
    clock, rng = _Clock(), np.random.default_rng(1)
    stamps = 5000 + np.arange(60) / 30
    late = 0.004 + 0.02 * rng.random(60)
    found = np.array([clock.host(s, s - 4990 + d) for s, d in zip(stamps, late, strict=True)])
    steps = np.diff(found)[20:]
    assert np.ptp(steps) < 0.1 * np.ptp(np.diff(late)[20:])
    assert (found <= stamps - 4990 + late + 1e-9).all()


def test_a_stamp_is_in_seconds_whatever_the_cameras_clock_counts() -> None:
    ticks: Any = SimpleNamespace(timestamp=3_000_000, timestamp_frequency=1_000_000)
    assert _stamp(ticks) == 3.0
    assert _stamp(SimpleNamespace(timestamp=0, timestamp_frequency=1)) is None
    assert _stamp(SimpleNamespace()) is None
    assert _Clock().host(None, 12.5) == 12.5


def test_a_missing_camera_feature_is_reported_where_it_was_requested() -> None:
    capture = open_capture(RED)
    refused = settle(capture, CameraSettings(width=400, height=400, rate=30.0, exposure=5000.0))
    assert refused == ["the camera keeps exposure at -1 instead of 5000"]
    assert capture.get(cv2.CAP_PROP_AUTO_EXPOSURE) == 0.25
    capture.release()
