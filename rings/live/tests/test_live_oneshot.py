"""A one-shot sensor made of software: live, recorded, replayed, and calibrated by hand."""

import json
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest

from rings.live.tests.oneshot import BALL_MM, BY_HAND, MOVING, PIXEL_MM, calibrated
from tactograph.graph.run.open_pipeline import load, open_pipeline
from tactograph.rings.oneshot.nodes.file.read_press_calibration import read_press_calibration
from tactograph.rings.oneshot.nodes.presses.read_presses import read_presses
from tests.fixtures import MadeOnce, python
from tests.pipelines.conftest import errors

pytestmark = pytest.mark.realtime


@pytest.fixture(scope="module")
def mini(made_once: MadeOnce) -> Path:
    return made_once("mini.npz", calibrated)


def run(graph: str, **values: object) -> None:
    with open_pipeline(graph, values) as pipeline:
        list(pipeline.items())


def test_every_frame_gives_a_height(mini: Path) -> None:
    arguments = {"calibration": mini, "camera": MOVING}
    assert np.median(errors("live_oneshot", arguments, 15)) < 0.008


@pytest.mark.parametrize("lights", ["bgr", "rgb"])
def test_a_calibration_renders_its_own_film(mini: Path, lights: str) -> None:
    """Nothing is stated of the rig: pictures are rendered through the calibration itself."""
    arguments = {"calibration": mini, "camera": "simulated?press_s=4", "lights": lights}
    assert np.median(errors("live_oneshot", arguments, 15, least_mm=0.3)) < 0.02


def test_leds_that_warm_up_are_followed(mini: Path) -> None:
    """All colours begin a fifth brighter, and fade each at its own pace."""
    arguments = {"calibration": mini, "camera": f"{MOVING}&warm_up=0.2&warm_s=6"}
    assert np.median(errors("live_oneshot", arguments, 40)[25:]) < 0.012


def test_read_camera_stands_in_for_read_capture(mini: Path, tmp_path: Path) -> None:
    arguments = {"camera": "$camera", "calibration": "$calibration"}
    graph = {
        "format": 1,
        "extends": "gelsight_mini",
        "params": {"camera": {"kind": "text"}, "capture": {"kind": "path", "default": None}},
        "patch": [{"replace": "frames", "op": "read_camera", "with": arguments}],
    }
    arguments = {"calibration": mini, "camera": MOVING, "out": tmp_path}
    assert np.median(errors(graph, arguments, 5)) < 0.008


def test_a_recording_gives_the_same_heights_again(mini: Path, tmp_path: Path) -> None:
    arguments = {"calibration": mini, "recording": tmp_path / "kept"}
    with open_pipeline("record_oneshot", {**arguments, "camera": MOVING}) as pipeline:
        live = [result["height"].copy() for result in islice(pipeline.items(), 4)]
    with load("replay_oneshot", **arguments, speed=0, out=str(tmp_path / "preview")) as pipeline:
        again = [result["height"].copy() for result in pipeline.items()]
    assert len(again) >= len(live)
    for height in live:
        assert min(float(np.abs(height - other).max()) for other in again) < 2e-3


def test_a_recording_is_shown_in_colour(mini: Path, tmp_path: Path) -> None:
    arguments = {"calibration": mini, "recording": tmp_path / "kept"}
    run("record_oneshot", **arguments, camera=MOVING, seconds=1, out=str(tmp_path / "out"))
    run("replay_oneshot", **arguments, speed=0, out=str(tmp_path / "preview"))
    picture = cv2.imread(str(tmp_path / "preview" / "latest.png"))
    camera = picture[60:200, 760:1000].astype(int)
    assert (np.ptp(camera, axis=2) > 60).mean() > 0.2


def test_it_says_how_it_did(mini: Path, tmp_path: Path) -> None:
    run("live_oneshot", calibration=str(mini), camera=MOVING, seconds=3, out=str(tmp_path))
    record = json.loads((tmp_path / "result.json").read_text())
    assert record["metrics"]["rmse_um"] < 10
    assert record["settings"]["lights"] == "bgr"
    assert "cycle" not in record["settings"]


def test_rerun_gets_one_picture_in_colour(mini: Path, tmp_path: Path) -> None:
    file = tmp_path / "live.rrd"
    arguments = {"calibration": mini, "camera": MOVING, "viewer": "none", "file": file}
    run("live_oneshot_rerun", **arguments, seconds=1, out=str(tmp_path / "out"))
    held = file.read_bytes()
    assert b"/camera/colour" in held
    assert b"/camera/led1" not in held


@pytest.fixture(scope="module")
def guided(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The calibration of a guided session of four presses."""
    file = tmp_path_factory.mktemp("guided") / "mini.npz"
    command = ["-m", "tactograph.graph.command", "run", "calibrate_live_oneshot"]
    command += [f"camera={BY_HAND}", f"ball_radius_mm={BALL_MM}", f"pixel_size_mm={PIXEL_MM}"]
    command += [f"out={file}", "presses_at_most=4", "--set", "presses.still_s=0.15"]
    done = python(*command)
    file.with_suffix(".out").write_text(done.stdout)
    file.with_suffix(".err").write_text(done.stderr)
    return file


def test_a_guided_session_asks_press_by_press_and_calibrates(guided: Path) -> None:
    assert read_press_calibration(file=guided).flat.shape == (3, 72, 96)
    asked = guided.with_suffix(".err").read_text().splitlines()
    assert asked[:2] == [
        "Take everything off the film, and leave it alone.",
        "Press the ball into the film, and hold it still.",
    ]
    assert any(line.startswith("Press 4 is taken: let go. Next: press") for line in asked)
    assert "held out" in guided.with_suffix(".out").read_text()


def test_a_guided_sessions_captures_can_be_calibrated_from_again(guided: Path) -> None:
    kept = guided.with_name("mini_presses")
    again = read_presses(folder=kept / "pressed", flat=kept / "untouched")
    assert again.names == ["01", "02", "03", "04"]
    np.testing.assert_allclose(read_press_calibration(file=guided).flat, again.flat, atol=2e-5)
