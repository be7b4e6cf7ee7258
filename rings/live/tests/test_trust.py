"""Wrong input of streams and one-shot sensors is warned of or refused; valid touches are not."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from rings.live.tests.oneshot import calibrated, pressed
from tactograph.graph import load
from tactograph.graph.files.read_graph import read_graph, shipped_names
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.graph.run.pipeline import Pipeline
from tests.fixtures import MadeOnce, real_data
from tests.pipelines.test_trust import (
    WRONG,
    Images,
    Wrong,
    every_fourth_line_mirrored,
    torn,
    verdict,
)

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")
LIVE = [name for name in shipped_names() if name.startswith(("live", "replay", "ros2"))]


@pytest.mark.parametrize("name", LIVE)
def test_a_live_stream_is_forced_from_the_start(name: str) -> None:
    graph = read_graph(name)
    if any(entry.op == "judge_touch" for entry in graph.nodes.values()):
        assert graph.params["accept_contradictions"].default is True


COLOURS: dict[str, Wrong] = {
    **{what: WRONG[what] for what in ("gamma 2.2", "gamma 1/2.2", "turned", "mirrored")},
    "channels reversed": lambda touch, _: touch[::-1].copy(),
    "other light": lambda touch, _: np.minimum(touch, 250) + np.uint8(6),
    "torn": torn,
    "every fourth line mirrored": every_fourth_line_mirrored,
    "grey": lambda touch, _: touch.mean(axis=0).astype(np.uint8)[None].repeat(3, axis=0),
}


def calibrated_by_balls(file: Path) -> None:
    """A real sensor's calibration."""
    data = real_data("gelsight_mini_balls")
    images = {"captures": str(data / "6.310mm"), "flat": data / "background.png"}
    known = {"ball_radius_mm": 3.155, "pixel_size_mm": 0.0634, "out": file}
    list(open_pipeline("calibrate_presses", images | known).items())


def real_presses() -> list[Images]:
    folder = real_data("gelsight_mini_balls") / "6.310mm"
    files = [next((folder / str(n)).glob("*.png")) for n in (2, 9, 19, 25, 31, 40)]
    return [cv2.imread(str(file)).transpose(2, 0, 1).astype(np.uint8) for file in files]


OneShot = tuple[Pipeline, list[Images]]


@pytest.fixture(scope="module", params=["simulated", pytest.param("real", marks=pytest.mark.slow)])
def one_shot(request: pytest.FixtureRequest, made_once: MadeOnce) -> OneShot:
    """A one-shot sensor, simulated or real, and presses into it."""
    if request.param == "real":
        file, presses = made_once("real_mini.npz", calibrated_by_balls), real_presses()
    else:
        file = made_once("mini.npz", calibrated)
        presses = [frame.transpose(2, 0, 1).copy() for frame in pressed(6).frames]
    return load("gelsight_mini", calibration=str(file)), presses


def test_right_presses_of_a_one_shot_sensor_are_trusted(one_shot: OneShot) -> None:
    pipeline, presses = one_shot
    assert [verdict(pipeline, press) for press in presses] == [""] * 6


@pytest.mark.parametrize("what", COLOURS)
def test_wrong_pictures_of_a_one_shot_sensor_give_a_warning(one_shot: OneShot, what: str) -> None:
    pipeline, presses = one_shot
    assert all(verdict(pipeline, COLOURS[what](press, press)) for press in presses)
