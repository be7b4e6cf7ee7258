"""What is made with one sensor is not read with another's calibration, unless on purpose."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rings.recording.tests.recordings import PROVENANCE, SIZE, light_of, make_cycle
from tactograph.graph import InputError, Session
from tactograph.graph.disk.file_identity import file_identity
from tactograph.graph.errors import collect_warnings
from tactograph.nodes.calibrate.file.read_calibration import read_calibration
from tactograph.nodes.calibrate.file.write_calibration import write_calibration
from tactograph.nodes.capture.read_capture import read_capture
from tactograph.nodes.files.sensor_identity import UsedCalibration, identity_in
from tactograph.nodes.stream.frames import LiveState
from tactograph.rings.live.nodes.camera.camera_params import CameraParams
from tactograph.rings.recording.files.mcap_log import log_files
from tactograph.rings.recording.files.mcap_read import McapFile
from tactograph.rings.recording.nodes.record import record
from tactograph.rings.recording.nodes.replay import replay
from tests.graph.conftest import Command, one_line, tactograph
from tests.nodes.capture.test_read_capture import IMAGES, write as write_images
from tests.nodes.files.test_calibration_file import ARRAYS, FILM, LENS, MADE, MISFIT, NOISE, random

__all__ = ["tactograph"]
Calibrated = Callable[..., Path]


@pytest.fixture
def calibrated(tmp_path: Path) -> Calibrated:
    """The calibration of a sensor of that name and serial number, if it has them."""

    def make(name: str | None, serial: str | None = None, **made: object) -> Path:
        file = tmp_path / f"{name}.npz"
        film = (random(4, *SIZE), random(*SIZE), *ARRAYS[2:], FILM)
        area = np.ones(SIZE, np.uint8)
        write_calibration(
            *film, NOISE, 1.5, LENS, MISFIT, {}, [], area, serial,
            file=file, sensor=name, provenance=replace(MADE, **made),
        )  # fmt: skip
        return file

    return make


def recorded(folder: Path, calibration: Path, serial: str = "") -> Path:
    """A recording made with a calibration, by a camera of that serial number."""
    made = replace(PROVENANCE, inputs={"calibration": file_identity(calibration)})
    frames, session = make_cycle(0), Session()
    state = LiveState(settings={"serial": serial})
    record(
        frames, light_of(frames), "1", state, folder=folder, provenance=made, session=session
    )  # fmt: skip
    session.close()
    return folder


def test_a_recording_is_replayed_with_its_sensor(tmp_path: Path, calibrated: Calibrated) -> None:
    left, right = calibrated("left"), calibrated("right")
    recording = recorded(tmp_path / "touch", left)
    assert len(list(replay(recording=recording, calibration=left, speed=0))) == 1
    with pytest.raises(InputError) as refusal:
        list(replay(recording=recording, calibration=right, speed=0))
    (line,) = str(refusal.value).splitlines()
    assert "is of sensor 'left', but the calibration" in line
    assert "is of sensor 'right'" in line
    assert "`another_sensor`=true" in line
    with collect_warnings([]) as told:
        again = replay(recording=recording, calibration=right, another_sensor=True, speed=0)
        assert len(list(again)) == 1
    assert "taken on purpose" in told[0]


def test_sensors_of_one_name_differ_by_camera(tmp_path: Path, calibrated: Calibrated) -> None:
    mini = calibrated("mini", "28F5K4RR")
    list(replay(recording=recorded(tmp_path / "a", mini, "28F5K4RR"), calibration=mini, speed=0))
    other = recorded(tmp_path / "b", mini, "28F5K4ZZ")
    with pytest.raises(InputError, match=r"serial 28F5K4ZZ, but .* serial 28F5K4RR"):
        list(replay(recording=other, calibration=mini, speed=0))


@pytest.mark.parametrize("names", [(None, "right"), ("left", None), (None, None)])
def test_a_file_that_does_not_know_its_sensor_fits_any(
    tmp_path: Path, calibrated: Calibrated, names: tuple[str | None, str | None]
) -> None:
    one, other = map(calibrated, names)
    recording = recorded(tmp_path / "touch", one)
    assert len(list(replay(recording=recording, calibration=other, speed=0))) == 1


def test_a_recording_keeps_the_calibration_that_it_was_made_with(
    tmp_path: Path, calibrated: Calibrated
) -> None:
    left = calibrated("left")
    (file,) = log_files(recorded(tmp_path / "touch", left))
    read = McapFile(file)
    list(read.messages())
    known = json.loads(read.about["inputs"])["calibration"]
    assert read.about["sensor"] == known["sensor"] == "left"
    assert (known["hash"], known["date"]) == tuple(file_identity(left)[n] for n in ("hash", "date"))


@pytest.mark.parametrize("beside", ["touches/1", "touches"])
def test_a_capture_that_names_its_sensor_is_refused_by_another(
    tmp_path: Path, calibrated: Calibrated, beside: str
) -> None:
    left, right = calibrated("left"), calibrated("right")
    write_images(tmp_path / "touches" / "1", IMAGES)
    (tmp_path / beside / "capture.yaml").write_text("sensor: left\n")
    for folder in (tmp_path / "touches", tmp_path / "touches" / "1"):
        assert len(list(read_capture(folder=folder, calibration=left))) == 1
        assert len(list(read_capture(folder=folder))) == 1
        with pytest.raises(InputError, match=r"is of sensor 'left', but .* is of sensor 'right'"):
            list(read_capture(folder=folder, calibration=right))


def test_a_camera_is_not_used_with_the_calibration_of_another(calibrated: Calibrated) -> None:
    mini = UsedCalibration(calibrated("mini", "A1"))
    CameraParams("serial:A1").check_calibration(mini)
    CameraParams("simulated").check_calibration(mini)
    with pytest.raises(InputError, match=r"`camera`=serial:B2: is of serial B2, but .* serial A1"):
        CameraParams("serial:B2").check_calibration(mini)


def test_a_calibration_keeps_name_and_serial_of_its_sensor(calibrated: Calibrated) -> None:
    """Also one that was made from another; in a message they are one line."""
    inputs = {"calibration": file_identity(calibrated("left"))}
    assert file_identity(calibrated(None, inputs=inputs))["sensor"] == "left"
    assert read_calibration(file=calibrated("mini", "A1")).serial == "A1"
    assert read_calibration(file=calibrated("left")).serial is None
    assert str(identity_in({"sensor": "a\nb\x1b[2J", "serial": 7})).isprintable()


GRAPH = """
format: 1
title: The first light
params:
  capture:     {kind: path}
  calibration: {kind: path}
prefer: [numpy]
nodes:
  frames: {op: read_capture, with: {folder: $capture, calibration: $calibration}}
  lit:    {op: label_lit, in: {light: frames.image}}
outputs: {lit: lit}
"""


def test_a_store_of_another_sensor_is_refused_by_both_names(
    tmp_path: Path, calibrated: Calibrated, tactograph: Command
) -> None:
    write_images(tmp_path / "touches" / "1", IMAGES)
    graph, used, store = (tmp_path / name for name in ("first.yaml", "used.npz", "all.zarr"))
    graph.write_text(GRAPH)
    words = ("batch", graph, f"calibration={used}", "--out", store)
    words += ("--over", tmp_path / "touches" / "*")
    calibrated("left").replace(used)
    assert tactograph(*words).code == 0
    shown = tactograph("show", store).out
    assert "calibration: hash" in shown
    assert "sensor left, date 20" in shown
    calibrated("right").replace(used)
    said = one_line(tactograph(*words))
    assert "another content of calibration, for sensor 'left' and not 'right'" in said


def test_results_name_the_calibration_they_were_made_with(
    tmp_path: Path, calibration: Callable[[str], str], raytraced: Path, tactograph: Command
) -> None:
    known = calibration("near33")
    with np.load(known) as arrays:
        changed = {name: arrays[name] for name in arrays.files}
    about = {**json.loads(str(changed["about"])), "sensor": "left"}
    np.savez(tmp_path / "cal.npz", **{**changed, "about": np.array(json.dumps(about))})
    words = ("run", "paper", f"calibration={tmp_path / 'cal.npz'}", f"out={tmp_path / 'out'}")
    touch = raytraced / "near33" / "cat"
    assert tactograph(*words, f"capture={touch}").code == 0
    inputs = json.loads((tmp_path / "out" / "result.json").read_text())["inputs"]
    assert inputs["calibration"] == file_identity(tmp_path / "cal.npz")
    assert inputs["calibration"]["sensor"] == "left"
    assert "calibration: hash" in tactograph("show", tmp_path / "out").out
