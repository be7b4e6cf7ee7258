"""A one-shot sensor's stream: every colour frame is a touch, and faults are reported."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from rings.live.tests.faulty import Faults, faults_of, let_fail
from rings.live.tests.oneshot import MOVING, calibrated
from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.nodes.calibrate.file.read_calibration import read_calibration
from tactograph.rings.frames.live_frames import ALL_LIT
from tactograph.rings.frames.rest_film import make_film
from tactograph.rings.live.nodes.camera.camera_params import CameraParams
from tactograph.rings.live.nodes.simulated.simulated_camera import SimulatedCamera
from tactograph.rings.live.nodes.simulated.simulated_colour_sensor import (
    ColourScene,
    SimulatedColourSensor,
)
from tactograph.rings.live.nodes.simulated.simulated_sensor import read_scene
from tactograph.rings.live.nodes.touches import sensor as live_sensor
from tactograph.rings.live.nodes.touches.colour_stream import ColourStream, planes_of
from tactograph.rings.live.nodes.touches.read_camera import read_camera
from tactograph.rings.live.nodes.touches.sensor import open_colour_sensor
from tests.fixtures import Calibration, MadeOnce

pytestmark = pytest.mark.realtime

DRIVER, SIZE = CameraParams(MOVING, timeout_s=0.3), (96, 72)
FILM = SimulatedColourSensor(read_scene(MOVING, ColourScene), start=0.0)
FLAT = planes_of(np.mean([FILM.picture(0.0, n) for n in range(8)], axis=0), "bgr", 255)


@pytest.fixture
def stream(monkeypatch: pytest.MonkeyPatch) -> Iterator[ColourStream]:
    let_fail(monkeypatch)
    sensor = open_colour_sensor(DRIVER, SIZE)
    yield ColourStream(sensor, make_film(FLAT))
    sensor.close()


def table(stream: ColourStream) -> SimulatedColourSensor:
    assert stream.sensor.table is not None
    return stream.sensor.table


def warnings_of(stream: ColourStream, touches: int = 3) -> list[str]:
    """The warnings until so many touches have come."""
    with collect_warnings([]) as lines:
        list(stream.touches(items=stream.state.touches + touches))
    return lines


@pytest.fixture(scope="module")
def mini(made_once: MadeOnce) -> Path:
    return made_once("mini.npz", calibrated)


def test_every_colour_frame_is_a_touch_of_three_lights(stream: ColourStream) -> None:
    touch = next(stream.touches())
    assert touch.image.shape == (3, 72, 96)
    frame = touch.new[-1]
    assert frame.led == ALL_LIT
    np.testing.assert_allclose(touch.image[2], frame.data[..., 2] / np.float32(255), atol=1e-6)
    assert 0 <= time.monotonic() - touch.time < 1


def test_the_newest_frame_counts_and_older_ones_are_attached(stream: ColourStream) -> None:
    next(stream.touches())
    time.sleep(0.25)
    touch = next(stream.touches())
    assert len(touch.new) > 2
    assert touch.time == touch.new[-1].time
    assert touch.state.dropped >= len(touch.new) - 1


def test_the_calibration_says_that_it_is_a_one_shot_sensor(mini: Path) -> None:
    touch = next(read_camera(camera=MOVING, calibration=mini))
    assert touch.image.shape == (3, 72, 96)
    assert touch.truth is not None
    assert touch.state.settings["lights"] == "bgr"


def test_red_comes_first_where_the_calibration_counts_so(mini: Path) -> None:
    blue_first = next(read_camera(camera=MOVING, calibration=mini))
    red_first = next(read_camera(camera=MOVING, calibration=mini, lights="rgb"))
    assert np.abs(red_first.image[::-1] - blue_first.image).mean() < 0.02
    assert np.abs(red_first.image - blue_first.image).mean() > 0.05


@pytest.mark.parametrize(
    ("spoil", "fault", "says"),
    [
        (lambda faults: setattr(faults, "flooded", True), "saturated", "saturated"),
        (lambda faults: setattr(faults, "covered", True), "covered", "is the lens covered"),
        (lambda faults: setattr(faults, "size", (48, 36)), "wrong size", "another size"),
        (lambda faults: faults.frames.extend(["double"]), "doubled", "twice"),
    ],
)
def test_frames_without_film_are_discarded_and_reported(
    stream: ColourStream, spoil: Callable[[Faults], None], fault: str, says: str
) -> None:
    warnings_of(stream)
    faults = faults_of(stream.sensor.table)
    spoil(faults)
    with collect_warnings([]) as lines:
        list(stream.touches(timeout=0.1, seconds=0.4))
        faults.flooded, faults.covered, faults.size = False, False, None
        assert list(stream.touches(items=stream.state.touches + 3, seconds=5))
    assert stream.state.faults[fault]
    assert any(says in line for line in lines)


def test_the_stream_resumes_when_the_camera_returns(stream: ColourStream) -> None:
    warnings_of(stream)
    faults_of(stream.sensor.table).plugged = False
    time.sleep(0.4)
    faults_of(stream.sensor.table).plugged = True
    assert len(list(stream.touches(items=stream.state.touches + 3, seconds=5))) == 3
    assert stream.state.faults["camera lost"]


def test_a_colour_that_fades_is_named(stream: ColourStream) -> None:
    assert not any("bright" in line for line in warnings_of(stream))
    table(stream).strength[1] = 0.8
    time.sleep(0.1)
    assert any(line.startswith("green is not as bright") for line in warnings_of(stream))
    assert not stream.state.faults["covered"]


def test_a_grey_camera_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    class Grey(SimulatedCamera):
        def retrieve(self) -> tuple[bool, np.ndarray | None]:
            there, frame = super().retrieve()
            return there, None if frame is None else frame[..., 0]

    monkeypatch.setattr(live_sensor, "SimulatedCamera", Grey)
    with pytest.raises(InputError, match="delivers grey pictures"):
        open_colour_sensor(DRIVER, SIZE)


def test_a_picture_of_another_size_is_refused() -> None:
    with pytest.raises(InputError, match="delivers 96 x 72 pixels, but the calibration is for 64"):
        open_colour_sensor(DRIVER, (64, 48))


def test_a_calibration_of_four_leds_is_refused_for_a_colour_sensor(
    calibration: Calibration,
) -> None:
    with pytest.raises(InputError, match="is of 4 LEDs, but a colour picture holds 3 lights"):
        next(read_camera(camera=MOVING, calibration=Path(calibration("far28")), lights="bgr"))


@pytest.mark.parametrize("seconds", [None, 0.2])
def test_a_stream_without_a_usable_frame_names_the_calibration(
    calibration: Calibration, tmp_path: Path, seconds: float | None
) -> None:
    """It ended in "its stream ended before the first item"."""
    far28, file = Path(calibration("far28")), tmp_path / "dark.avi"
    rows, columns = read_calibration(file=far28).flat.shape[1:]
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"FFV1"), 30, (columns, rows))
    for _ in range(12):
        writer.write(np.zeros((rows, columns, 3), np.uint8))
    writer.release()
    touches = read_camera(camera=str(file), port="none", calibration=far28, seconds=seconds)
    with pytest.raises(InputError, match=r"none of \d+ frames .* calibration .*npz of .* sensor"):
        next(touches)
