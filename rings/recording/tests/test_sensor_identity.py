"""A recording is not replayed with another sensor's calibration, unless on purpose."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from rings.recording.tests.recordings import PROVENANCE, light_of, make_cycle
from tactograph.graph import InputError, Session
from tactograph.graph.disk.file_identity import file_identity
from tactograph.graph.errors import collect_warnings
from tactograph.nodes.stream.touch import LiveState
from tactograph.rings.recording.files.mcap_log import log_files
from tactograph.rings.recording.files.mcap_read import McapReader
from tactograph.rings.recording.nodes.record import record
from tactograph.rings.recording.nodes.replay import replay
from tests.nodes.files.test_sensor_identity import Calibrated, calibrated

__all__ = ["calibrated"]


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
    with collect_warnings([]) as messages:
        again = replay(recording=recording, calibration=right, another_sensor=True, speed=0)
        assert len(list(again)) == 1
    assert "taken on purpose" in messages[0]


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


def test_a_recording_holds_the_calibration_in_use(tmp_path: Path, calibrated: Calibrated) -> None:
    left = calibrated("left")
    (file,) = log_files(recorded(tmp_path / "touch", left))
    read = McapReader(file)
    list(read.messages())
    known = json.loads(read.about["inputs"])["calibration"]
    assert read.about["sensor"] == known["sensor"] == "left"
    assert (known["hash"], known["date"]) == tuple(file_identity(left)[n] for n in ("hash", "date"))
