"""A stream of touches goes on, whatever happens to camera, controller and LEDs.

The sensor is made of software; its controller speaks the real protocol over a pseudo-terminal
and its camera has the interface of OpenCV's.
"""

import logging
import threading
import time
from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from rings.live.tests.faulty import FaultyController, faults_of, let_fail, on_usb
from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.nodes import F4
from tactograph.rings.frames.live_frames import LiveFrames
from tactograph.rings.frames.rest_film import make_film
from tactograph.rings.live.nodes.camera.camera_params import CameraParams
from tactograph.rings.live.nodes.camera.open_camera import CameraSettings, settle
from tactograph.rings.live.nodes.simulated.simulated_sensor import (
    Scene,
    SimulatedSensor,
    read_scene,
)
from tactograph.rings.live.nodes.touches.sensor import Rig, open_rig
from tactograph.rings.live.nodes.touches.touch_stream import Stream

pytestmark = pytest.mark.realtime

WIDTH, HEIGHT, RATE = 160, 120, 30.0
SCENE = (
    f"simulated?width_px={WIDTH}&height_px={HEIGHT}&pixel_size_mm=0.15&slant_deg=33"
    "&distance_mm=60&depth_mm=0.8&path_mm=1"
)
LATEST = 2.5
"""Seconds within which a stream has to be back, on a machine that does much else besides."""
DARK = np.zeros((HEIGHT, WIDTH), np.float32)


@cache
def flat() -> F4:
    sensor = SimulatedSensor(read_scene(SCENE, Scene))
    return np.stack([sensor._bare[k] for k in range(4)])


def opened(
    port: str = "none", camera: str = SCENE, size: tuple[int, int] = (WIDTH, HEIGHT),
    timeout_s: float = 0.5, **options: Any,
) -> Rig:  # fmt: skip
    driver = CameraParams(camera, rate=RATE, timeout_s=timeout_s)
    return open_rig(driver, port, size, leds=4, **options)


def stream_of(sensor: Rig) -> Stream:
    return Stream(sensor, make_film(flat(), DARK), DARK)


class Running:
    """A stream in a thread of its own, as it runs in a pipeline."""

    def __init__(self, sensor: Rig) -> None:
        assert sensor.table is not None
        assert isinstance(sensor.board, FaultyController)
        self.sensor, self.board = sensor, sensor.board
        self.faults = faults_of(sensor.table)
        self.stream = stream_of(sensor)
        self.touches: list[tuple[float, LiveFrames]] = []
        self.lines: list[str] = []
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._end = False
        # Messages while no touch comes go there at once.
        self._handler = logging.Handler()
        self._handler.emit = lambda record: self.lines.append(record.getMessage())
        logging.getLogger("tactograph").addHandler(self._handler)
        self._thread.start()

    def _run(self) -> None:
        with collect_warnings(self.lines):
            for touch in self.stream.touches():
                self.touches.append((time.monotonic(), touch))
                if self._end:
                    return

    def stop(self) -> None:
        self._end = True
        self._thread.join(3)
        logging.getLogger("tactograph").removeHandler(self._handler)
        self.sensor.close()

    def count(self, fault: str) -> int:
        return self.stream.state.faults[fault]

    def back_after(self, moment: float) -> float:
        """Seconds from a moment until three touches, exposed later, have come."""
        until = moment + LATEST
        while time.monotonic() < until:
            later = [come for come, touch in self.touches if touch.time > moment]
            if len(later) >= 3:
                return later[2] - moment
            time.sleep(0.005)
        pytest.fail(f"no touches within {LATEST} s; {dict(self.stream.state.faults)}")

    def check_clean(self, without: int = 0) -> None:
        """No touch holds another LED's light, or that of two."""
        for _, touch in self.touches:
            for k in range(4):
                if k + 1 != without:
                    off = np.abs(touch.image[k] / flat()[k] - 1)
                    assert np.median(off) < 0.02, (touch.name, k + 1)


@pytest.fixture(scope="module")
def running() -> Iterator[Running]:
    with pytest.MonkeyPatch.context() as patch:
        let_fail(patch)
        running = Running(opened("simulated", timeout_s=0.3))
        on_usb(patch, running.board)
        running.back_after(time.monotonic())
        yield running
        running.stop()


@pytest.fixture(autouse=True)
def calm(request: pytest.FixtureRequest) -> None:
    """Let a stream that a test uses be in order when the test begins."""
    if "running" in request.fixturenames:
        running = request.getfixturevalue("running")
        running.back_after(time.monotonic())
        running.touches.clear()


LASTING: dict[str, tuple[str, object, object]] = {
    "camera lost": ("plugged", False, True),
    "camera hangs": ("frozen", True, False),
    "wrong size": ("size", (WIDTH // 2, HEIGHT // 2), None),
    "covered": ("covered", True, False),
    "saturated": ("flooded", True, False),
}
"""What of the simulated camera changes for a while, and how it is mended."""


@pytest.mark.parametrize("fault", [*LASTING, "controller lost"])
def test_the_stream_recovers_soon_after_a_lasting_fault(
    running: Running, fault: str, record_property: Callable[[str, object], None]
) -> None:
    name = "camera lost" if fault == "camera hangs" else fault
    before = running.count(name)
    if fault in LASTING:
        what, wrong, right = LASTING[fault]
        setattr(running.faults, what, wrong)
    else:
        running.board.unplug()
    time.sleep(0.8)
    mended = time.monotonic()
    if fault in LASTING:
        setattr(running.faults, what, right)
    else:
        running.board.replug()
    record_property("recovery_s", round(running.back_after(mended), 3))
    assert running.count(name) > before
    running.check_clean()


def _overlap(running: Running) -> None:
    """A step's change somewhere in the exposure; a busy machine may miss it once."""
    before = running.count("mixed")
    for _ in range(5):
        running.sensor.lamps.shift(0.4)
        time.sleep(0.2)
        if running.count("mixed") > before:
            return


TROUBLES: dict[str, Callable[[Running], None]] = {
    "doubled": lambda running: running.faults.frames.append("double"),
    "lost": lambda running: running.faults.frames.append("lose"),
    "swapped": lambda running: running.faults.frames.append("swap"),
    "late": lambda running: running.faults.frames.append("late"),
    "controller reset": lambda running: running.board.reset(),
    "bad line": lambda running: running.board.noise(b"\xff\x00$! cycle 5 99*0000\n$12 ok t="),
    "mixed": _overlap,
}


@pytest.mark.parametrize("fault", TROUBLES)
def test_a_single_fault_costs_frames_and_no_height(
    running: Running, fault: str, record_property: Callable[[str, object], None]
) -> None:
    before = running.count(fault)
    moment = time.monotonic()
    TROUBLES[fault](running)
    time.sleep(0.6)
    record_property("recovery_s", round(running.back_after(moment + 0.1), 3))
    assert running.count(fault) > before, running.stream.state.faults
    running.check_clean()


def test_a_burnt_out_led_is_named_and_the_stream_continues(running: Running) -> None:
    running.board.burnt_out.add(2)
    time.sleep(1.0)
    running.back_after(time.monotonic())
    running.check_clean(without=2)
    assert running.touches[-1][1].image[1].max() < 0.05
    assert any("LED 2 stays dark" in line for line in running.lines)
    running.board.burnt_out.clear()
    time.sleep(0.3)
    running.touches.clear()
    running.back_after(time.monotonic())
    running.check_clean()


def test_every_fault_was_reported_in_one_line(running: Running) -> None:
    printed = "\n".join(running.lines)
    for part in ("another size", "film", "saturated", "twice", "missing", "camera is gone"):
        assert part in printed
    assert all("\n" not in line for line in running.lines)


def test_at_the_end_the_leds_are_dark_and_the_camera_closed() -> None:
    sensor = opened("simulated")
    touches = stream_of(sensor).touches()
    next(touches)
    touches.close()
    assert sensor.board is not None
    sensor.lamps.close()
    time.sleep(0.05)
    now = time.monotonic()
    assert sensor.board.lit_between(now - 0.02, now) == []
    sensor.close()


def test_a_slow_reader_gets_the_newest_frames_and_drops_are_counted() -> None:
    sensor = opened(queue=4)
    stream = stream_of(sensor)
    touches = stream.touches()
    next(touches)
    time.sleep(0.5)
    touch = next(touches)
    assert time.monotonic() - touch.time < 0.3
    assert len(touch.new) == 4
    assert touch.state.dropped >= 8
    sensor.close()


def test_without_a_controller_the_images_decide() -> None:
    sensor = opened()
    touches = list(stream_of(sensor).touches(items=8))
    sensor.close()
    frames = [frame for touch in touches for frame in touch.new]
    for one, next_ in pairwise(frames):
        steps = round((next_.time - one.time) * RATE)
        assert (next_.led - one.led - steps) % 4 == 0


def test_ambient_light_is_measured_in_a_step_of_its_own_and_taken_off() -> None:
    sensor = opened(camera=f"{SCENE}&ambient=0.08", ambient=True)
    *_, touch = stream_of(sensor).touches(items=12)
    sensor.close()
    assert np.median(touch.image / flat(), axis=(1, 2)) == pytest.approx(1, abs=0.003)


def test_a_camera_at_another_rate_than_the_leds_is_reported() -> None:
    """Half of the frames are missing; each of the others shows its LED all the same."""
    sensor = opened()
    sensor.rate = 2 * RATE
    stream = stream_of(sensor)
    for _ in stream.touches(seconds=2.6):
        pass
    sensor.close()
    assert stream.state.faults["wrong rate"] == 1


def test_an_led_that_is_not_as_bright_as_calibrated_is_named() -> None:
    sensor = opened()
    assert sensor.table is not None
    with collect_warnings([]) as lines:
        touches = stream_of(sensor).touches()
        next(touches)
        assert not lines
        sensor.table.strength[2] = 0.8
        for _ in range(8):
            next(touches)
    sensor.close()
    assert any(line.startswith("LED 3 is not as bright") for line in lines)


def test_the_truth_of_a_simulated_touch_is_the_films_height() -> None:
    sensor = opened()
    (touch,) = stream_of(sensor).touches(items=1)
    sensor.close()
    assert touch.truth.shape == (HEIGHT, WIDTH)
    assert 0 < touch.truth.max() < 0.8


def test_the_real_videocapture_reads_a_file_of_the_same_frames(tmp_path: Path) -> None:
    """Lossless, through OpenCV's own reader, at the file's pace and with an end."""
    table = SimulatedSensor(read_scene(SCENE, Scene), start=0.0)
    file = tmp_path / "touch.avi"
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"FFV1"), RATE, (WIDTH, HEIGHT))
    assert writer.isOpened()
    for n in range(20):
        shares = [np.full(HEIGHT, k == n % 4, np.float32) for k in range(4)]
        image = table.image(shares, 2 + n / RATE, n)
        writer.write(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    writer.release()
    sensor = opened(camera=str(file), queue=32)
    touches = list(stream_of(sensor).touches())
    sensor.close()
    frames = [frame for touch in touches for frame in touch.new]
    assert [frame.led for frame in frames] == [1, 2, 3, 4] * 5
    assert set(touches[-1].state.faults) <= {"moved"}


class Stubborn:
    """A camera whose driver ignores what it is asked."""

    def __init__(self) -> None:
        self.asked: dict[int, float] = {}

    def getBackendName(self) -> str:  # noqa: N802
        return "V4L2"

    def set(self, prop: int, value: float) -> bool:
        self.asked[prop] = value
        return False

    def get(self, prop: int) -> float:
        return {cv2.CAP_PROP_AUTO_EXPOSURE: 3.0, cv2.CAP_PROP_FPS: 15.0}.get(prop, 0.0)


def test_a_setting_refused_by_the_driver_is_reported() -> None:
    camera = Stubborn()
    refused = settle(camera, CameraSettings(width=640, height=480, rate=30.0, exposure=50))
    assert camera.asked[cv2.CAP_PROP_AUTO_EXPOSURE] == 1
    assert camera.asked[cv2.CAP_PROP_AUTO_WB] == 0
    assert any("exposure" in line and "50" in line for line in refused)
    assert any("frames per second at 15" in line for line in refused)


@pytest.mark.parametrize(
    ("camera", "port", "says"),
    [
        ("nowhere.avi", "none", "no such file"),
        ("/dev/video99", "none", "cannot be opened"),
        (SCENE, "/dev/ttyNOWHERE", "ttyNOWHERE"),
        ("simulated?radius=3", "none", "radius"),
        ("simulated?radius_mm=-3", "none", "greater than 0"),
    ],
)
def test_a_camera_that_cannot_be_opened_is_one_line(camera: str, port: str, says: str) -> None:
    with pytest.raises(InputError, match=says) as error:
        opened(port, camera).close()
    assert "\n" not in str(error.value)


def test_a_camera_of_another_size_is_refused_at_the_start() -> None:
    with pytest.raises(InputError, match="160 x 120 pixels"):
        opened(size=(80, 60)).close()


@pytest.mark.parametrize("stop", [KeyboardInterrupt, InputError])
@pytest.mark.parametrize(
    "where",
    [
        "camera.camera.Camera.check",
        "controller.led_controller.LedController._restore",
        "touches.sensor.ControlledLamps._start",
    ],
)
def test_nothing_stays_open_when_opening_is_broken_off(
    monkeypatch: pytest.MonkeyPatch, where: str, stop: type[BaseException]
) -> None:
    def broken_off(*_: object) -> None:
        raise stop("stopped")

    monkeypatch.setattr(f"tactograph.rings.live.nodes.{where}", broken_off)
    before = set(threading.enumerate())
    with pytest.raises(stop):
        opened("simulated")
    left = [thread for thread in threading.enumerate() if thread not in before]
    for thread in left:
        thread.join(2)
    assert [thread.name for thread in left if thread.is_alive()] == []


def test_a_camera_that_is_none_is_named_before_an_led_controller() -> None:
    with pytest.raises(InputError, match="`camera`=simulatd: there is no such file"):
        open_rig(CameraParams("simulatd"), None, (None, None), leds=4)
