"""A capture of one sensor is not read with another's calibration, unless on purpose."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.graph.disk.file_identity import file_identity
from tactograph.nodes.calibrate.file.read_calibration import read_calibration
from tactograph.nodes.calibrate.file.write_calibration import write_calibration
from tactograph.nodes.capture.read_capture import read_capture
from tactograph.nodes.files.sensor_identity import SensorIdentity
from tests.graph.conftest import Command, tactograph
from tests.nodes.capture.test_read_capture import IMAGES, write as write_images
from tests.nodes.files.test_calibration_file import (
    ARRAYS,
    FILM,
    LENS,
    MISFIT,
    NOISE,
    PROVENANCE,
    random,
)

__all__ = ["tactograph"]
SIZE = (24, 32)
Calibrated = Callable[..., Path]


@pytest.fixture
def calibrated(tmp_path: Path) -> Calibrated:
    """The calibration of a sensor of that name and serial number, if it has them."""

    def make(name: str | None, serial: str | None = None, **fields: object) -> Path:
        file = tmp_path / f"{name}.npz"
        film = (random(4, *SIZE), random(*SIZE), *ARRAYS[2:], FILM)
        area = np.ones(SIZE, np.uint8)
        write_calibration(
            *film, NOISE, 1.5, LENS, {}, [], area, MISFIT, serial,
            file=file, sensor=name, provenance=replace(PROVENANCE, **fields),
        )  # fmt: skip
        return file

    return make


@pytest.mark.parametrize("place", ["touches/1", "touches"])
def test_a_capture_that_names_its_sensor_is_refused_by_another(
    tmp_path: Path, calibrated: Calibrated, place: str
) -> None:
    left, right = calibrated("left"), calibrated("right")
    write_images(tmp_path / "touches" / "1", IMAGES)
    (tmp_path / place / "capture.yaml").write_text("sensor: left\n")
    for folder in (tmp_path / "touches", tmp_path / "touches" / "1"):
        assert len(list(read_capture(folder=folder, calibration=left))) == 1
        assert len(list(read_capture(folder=folder))) == 1
        with pytest.raises(InputError, match=r"is of sensor 'left', but .* is of sensor 'right'"):
            list(read_capture(folder=folder, calibration=right))


def test_a_calibration_keeps_name_and_serial_of_its_sensor(calibrated: Calibrated) -> None:
    """So does a calibration made from another; in a message they are one line."""
    inputs = {"calibration": file_identity(calibrated("left"))}
    assert file_identity(calibrated(None, inputs=inputs))["sensor"] == "left"
    assert read_calibration(file=calibrated("mini", "A1")).serial == "A1"
    assert read_calibration(file=calibrated("left")).serial is None
    assert str(SensorIdentity.stated_in({"sensor": "a\nb\x1b[2J", "serial": 7})).isprintable()


@pytest.mark.slow
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
