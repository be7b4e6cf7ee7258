"""The live graph, on a sensor made of software, from the command line as a user runs it."""

import itertools
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tactograph.graph import InputError
from tactograph.graph.run.open_pipeline import load, open_pipeline
from tests.fixtures import simulated_sensor
from tests.pipelines.conftest import errors

pytestmark = pytest.mark.realtime

SIZE = {"width_px": 160, "height_px": 120, "pixel_size_mm": 1 / 7}
RIG = {"slant_deg": 33, "distance_mm": 60}
SCENE = {**SIZE, **RIG, "depth_mm": 0.8, "path_mm": 2}
CAMERA = "simulated?" + "&".join(f"{name}={value}" for name, value in SCENE.items())


def run(graph: str, **values: object) -> None:
    for _ in open_pipeline(graph, values).items():
        pass


@pytest.fixture(scope="module")
def sensor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the calibration of the simulated sensor."""
    return simulated_sensor(tmp_path_factory.mktemp("live"), **SIZE, **RIG)


def arguments(sensor: Path, **more: object) -> dict[str, object]:
    cal, out = str(sensor / "cal.npz"), str(sensor / "out")
    return {"calibration": cal, "camera": CAMERA, "out": out, **more}


@pytest.mark.parametrize("port", ["none", "simulated"])
def test_heights_agree_with_the_truth_while_the_ball_moves(sensor: Path, port: str) -> None:
    assert np.median(errors("live", arguments(sensor, port=port), 25)) < 0.01


@pytest.mark.parametrize("port", ["none", "simulated"])
def test_a_calibration_renders_its_own_film(sensor: Path, port: str) -> None:
    """Nothing is stated of the rig: images are rendered through the calibration itself."""
    trial = arguments(sensor, port=port, camera="simulated?press_s=4")
    assert np.median(errors("live", trial, 15, least_mm=0.3)) < 0.01


def test_three_leds_go_on_when_one_is_burnt_out(sensor: Path) -> None:
    """A dark LED is to the flow what a shadow is that lies everywhere."""
    with open_pipeline("live", arguments(sensor, port="none")) as camera:
        result = next(itertools.islice(camera.items(), 20, None))
    image = next(made for value, made in result.item.items() if value.port == "image").copy()
    image[1] = 0.03 * image.max()  # hardly more than what is refused as dark
    three = load("reconstruct", calibration=str(sensor / "cal.npz"))(frames=image)
    assert np.sqrt(np.mean((three["height"] - result["height"]) ** 2)) < 0.02


def test_a_run_ends_after_its_seconds_and_reports_its_figures(
    sensor: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run("live", **arguments(sensor, port="simulated", seconds=4, out=str(sensor / "record")))
    record = json.loads((sensor / "record" / "result.json").read_text())
    metrics = record["metrics"]
    assert metrics["heights"] > 10
    assert metrics["rmse_um"] < 10
    assert 0 < metrics["latency_median_ms"] <= metrics["latency_99_percent_ms"] < 1000
    assert record["graph"]["name"] == "live"
    assert record["settings"]["cycle"] == [1, 2, 3, 4]
    assert "heights_per_s" in capsys.readouterr().out


def test_ctrl_c_ends_it_in_order(sensor: Path) -> None:
    command = [sys.executable, "-m", "tactograph.graph.command", "run", "live"]
    words = ["calibration=cal.npz", f"camera={CAMERA}", "port=simulated", "out=stopped"]
    pipe = subprocess.PIPE
    process = subprocess.Popen([*command, *words], cwd=sensor, stdout=pipe, stderr=pipe, text=True)
    assert "ms on" in process.stdout.readline()
    time.sleep(2.5)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=10)
    assert process.returncode == 0, err
    assert "Traceback" not in err
    assert "heights_per_s" in out
    assert (sensor / "stopped" / "result.json").is_file()


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"port": "/dev/ttyNOWHERE"}, "ttyNOWHERE"),
        ({"camera": "nowhere.avi", "port": "none"}, "no such file"),
        ({"camera": "0", "port": "simulated"}, "goes with"),
        ({"calibration": "nothing.npz"}, "nothing.npz"),
    ],
)
def test_a_missing_input_is_one_line(sensor: Path, wrong: dict[str, object], says: str) -> None:
    with pytest.raises(InputError, match=says) as error:
        run("live", **{**arguments(sensor), **wrong})
    assert "\n" not in str(error.value)
