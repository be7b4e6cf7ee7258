"""A sensor as a camera of LeRobot's: by its own maker of cameras, and in lerobot-record."""

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

pytest.importorskip("lerobot", reason="brings PyTorch; 'make test-lerobot' installs it")
import av
from lerobot.cameras.camera import Camera
from lerobot.cameras.configs import CameraConfig
from lerobot.cameras.utils import make_cameras_from_configs
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.robots import Robot, RobotConfig
from lerobot.scripts import lerobot_record
from lerobot.teleoperators import Teleoperator, TeleoperatorConfig

import tests.tactograph
from tactograph.rings.export.height_levels import OFFSET_MM, STEP_MM, level_height
from tactograph.rings.recording.files.level_pictures import picture_levels
from tactograph.rings.recording.lerobot import TactographCameraConfig
from tests.fixtures import simulated_sensor

pytestmark = pytest.mark.slow

SIZE = {"width_px": 80, "height_px": 60, "pixel_size_mm": 0.2}
RIG = {"slant_deg": 33, "distance_mm": 60}
SCENE = {**SIZE, **RIG, "depth_mm": 0.8, "radius_mm": 4, "press_s": 0.6, "rest_s": 0.2}
PARAMS = {
    "camera": "simulated?" + "&".join(f"{name}={value}" for name, value in SCENE.items()),
    "port": "simulated",
}


@pytest.fixture(scope="module")
def calibration(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return simulated_sensor(tmp_path_factory.mktemp("sensor"), **SIZE, **RIG) / "cal.npz"


LONG_MS = 600_000
"""Longer than any machine takes to begin: tests wait for pictures, not for times."""


@pytest.fixture(autouse=True)
def _patient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tactograph.rings.recording.lerobot.camera.START_S", LONG_MS / 1000)


@pytest.fixture
def sensor(calibration: Path) -> Callable[..., Camera]:
    """Make a camera by LeRobot's own means."""

    def make(**config: Any) -> Camera:
        wanted = {"calibration": str(calibration), "params": PARAMS, **config}
        return make_cameras_from_configs({"left": TactographCameraConfig(**wanted)})["left"]

    return make


def rose_and_fell(tops: list[float], low: float = 0.1, high: float = 0.7) -> bool:
    """Whether heights in mm, or shares of 1 mm, show a press of 0.8 mm and the film at rest."""
    return bool(tops) and min(tops) < low < high < max(tops) < 0.9


def test_every_picture_is_read_once_and_shows_the_press_in_micrometres(
    sensor: Callable[..., Camera],
) -> None:
    tops: list[float] = []
    with sensor(picture="levels") as camera:
        assert (camera.width, camera.height, camera.fps) == (80, 60, 30)
        while not rose_and_fell(tops) and len(tops) < 1000:
            levels = picture_levels(camera.async_read(timeout_ms=LONG_MS))
            tops.append(float(level_height(levels, STEP_MM, OFFSET_MM).max()))
    assert rose_and_fell(tops)
    assert not camera.is_connected
    with pytest.raises(ConnectionError, match="the stream has ended"):
        camera.read()


@pytest.mark.parametrize("picture", ["height", "lights"])
def test_a_picture_for_people_and_policies_has_three_channels_of_bytes(
    sensor: Callable[..., Camera], picture: str
) -> None:
    with sensor(picture=picture) as camera:
        shown, latest = camera.read(), camera.read_latest(max_age_ms=LONG_MS)
    assert [(each.shape, each.dtype) for each in (shown, latest)] == [((60, 80, 3), np.uint8)] * 2


def test_a_missing_sensor_is_reported_on_connect(sensor: Callable[..., Camera]) -> None:
    camera = sensor(params={**PARAMS, "camera": "simulated?radius=4"})
    with pytest.raises(ConnectionError, match="the stream has ended: camera=simulated"):
        camera.connect()
    assert not camera.is_connected


def test_a_size_that_the_calibration_does_not_have_is_refused(calibration: Path) -> None:
    with pytest.raises(ValueError, match=r"640 x 480: .* is for 80 x 60 pixels"):
        TactographCameraConfig(calibration=str(calibration), width=640, height=480)


KEYS = dict.fromkeys(["exit_early", "rerecord_episode", "stop_recording"], False)
"""The keys that someone beside the robot could press."""


class Still:
    """What a robot and its teleoperator say that have two joints and never move."""

    action_features: ClassVar[dict[str, Any]] = {"elbow.pos": float, "wrist.pos": float}
    feedback_features: ClassVar[dict[str, Any]] = {}
    is_connected = is_calibrated = True

    def connect(self, calibrate: bool = True) -> None: ...

    def calibrate(self) -> None: ...

    def configure(self) -> None: ...

    def disconnect(self) -> None: ...

    def get_action(self) -> dict[str, float]:
        return dict.fromkeys(self.action_features, 0.0)

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        return action

    def send_feedback(self, feedback: dict[str, Any]) -> None: ...


@RobotConfig.register_subclass("still")
@dataclass(kw_only=True)
class StillRobotConfig(RobotConfig):
    cameras: dict[str, CameraConfig] = field(default_factory=dict)


@TeleoperatorConfig.register_subclass("still")
@dataclass(kw_only=True)
class StillTeleopConfig(TeleoperatorConfig): ...


class StillTeleop(Still, Teleoperator):
    config_class, name = StillTeleopConfig, "still"


class StillRobot(Still, Robot):
    config_class, name = StillRobotConfig, "still"

    def __init__(self, config: StillRobotConfig) -> None:
        super().__init__(config)
        self.cameras = make_cameras_from_configs(config.cameras)
        self.tops: dict[str, list[float]] = {name: [] for name in self.cameras}

    @property
    def observation_features(self) -> dict[str, Any]:
        sizes = {name: (each.height, each.width, 3) for name, each in self.cameras.items()}
        return {**self.action_features, **sizes}

    def connect(self, calibrate: bool = True) -> None:
        for camera in self.cameras.values():
            camera.connect()

    def get_observation(self) -> dict[str, Any]:
        """Ask for the end of the episode once every sensor has shown a press."""
        pictures = {name: each.async_read(LONG_MS) for name, each in self.cameras.items()}
        for name, picture in pictures.items():
            self.tops[name].append(float(picture.max()) / 255)
        # A video changes what it shows by some hundredths.
        KEYS["exit_early"] = all(rose_and_fell(tops, 0.05, 0.75) for tops in self.tops.values())
        return {**dict.fromkeys(self.action_features, 0.0), **pictures}

    def disconnect(self) -> None:
        for camera in self.cameras.values():
            camera.disconnect()


def test_lerobot_record_takes_the_heights_of_two_sensors_into_one_dataset(
    calibration: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # LeRobot looks for a device in the package of its configuration.
    monkeypatch.setattr(tests.tactograph, "StillRobot", StillRobot, raising=False)
    monkeypatch.setattr(tests.tactograph, "StillTeleop", StillTeleop, raising=False)
    one = f"type: tactograph, calibration: {calibration}, white_mm: 1.0"
    live = ", ".join(f'{name}: "{value}"' for name, value in PARAMS.items())
    cameras = ", ".join(f"{side}: {{{one}, params: {{{live}}}}}" for side in ("left", "right"))
    options = {
        "robot.type": "still", "robot.discover_packages_path": "tactograph.rings.recording.lerobot",
        "robot.cameras": f"{{{cameras}}}", "teleop.type": "still", "dataset.repo_id": "local/data",
        "dataset.root": tmp_path / "data", "dataset.single_task": "hold still",
        "dataset.num_episodes": 1, "dataset.episode_time_s": LONG_MS / 1000,
        "dataset.reset_time_s": 0, "dataset.vcodec": "h264", "dataset.push_to_hub": "false",
        "play_sounds": "false",
    }  # fmt: skip
    arguments = [f"--{name}={value}" for name, value in options.items()]
    monkeypatch.setattr(sys, "argv", ["lerobot-record", *arguments])
    monkeypatch.setattr(lerobot_record, "init_keyboard_listener", lambda: (None, KEYS))
    lerobot_record.main()
    rows = LeRobotDataset("local/data", root=tmp_path / "data")
    for side in ("left", "right"):
        (video,) = (tmp_path / "data" / "videos" / f"observation.images.{side}").rglob("*.mp4")
        with av.open(video) as opened:
            shown = [frame.to_ndarray(format="rgb24") for frame in opened.decode(video=0)]
        assert rose_and_fell([float(picture.max()) / 255 for picture in shown])
        assert len(shown) == len(rows)
