"""Topics of ROS 2: heard by a plain node of a real ROS, which publishes camera images, too."""

import importlib.util
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rings.live.tests import oneshot
from tactograph.graph import InputError
from tactograph.graph.errors import collect_warnings
from tactograph.graph.run.open_pipeline import open_pipeline
from tactograph.nodes import F4
from tactograph.nodes.contact.measure_contact import measure_contact
from tactograph.rings.frames.calibrated_film import CalibratedFilm
from tactograph.rings.live.nodes.simulated.simulated_colour_sensor import (
    ColourScene,
    SimulatedColourSensor,
)
from tactograph.rings.live.nodes.simulated.simulated_sensor import read_scene
from tactograph.rings.recording.files.ros_messages import image_message
from tactograph.rings.recording.nodes._ros_node import RosNode
from tactograph.rings.recording.nodes.read_ros2 import RosTouches
from tests.fixtures import MadeOnce, simulated_sensor

PEER = Path(__file__).with_name("ros2_peer.py")
HAS_ROS = importlib.util.find_spec("rclpy") is not None
ROS_PYTHON = Path(sys.executable if HAS_ROS else Path(sys.prefix) / "ros2" / "bin" / "python")
needs_ros = pytest.mark.skipif(
    not ROS_PYTHON.exists(), reason="no ROS 2 is here: see tests/install_ros2.sh"
)
pytestmark = pytest.mark.slow
PIXEL_MM = 0.05
SIZE = {"width_px": 80, "height_px": 60, "pixel_size_mm": 2 / 7}


def started(task: str, *words: object) -> subprocess.Popen[str]:
    """Let the peer do something under ROS."""
    folders = [path for path in sys.path if path.endswith("site-packages")]
    command = [str(ROS_PYTHON), str(PEER), os.pathsep.join(folders), task, *map(str, words)]
    # Nobody beyond this machine, and none of the other tests, is to hear of it.
    own = {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_LOCALHOST_ONLY": "1",
        "ROS_DOMAIN_ID": str(1 + os.getpid() % 100),
    }
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, **pipes, text=True, env={**os.environ, **own})


def ask(task: str, *words: object) -> dict[str, Any]:
    """Let the peer do something under ROS, and return what it heard."""
    with started(task, *words) as peer:
        out, output = peer.communicate(timeout=100)
    assert peer.returncode == 0, output
    heard: dict[str, Any] = json.loads(out.splitlines()[-1])
    return heard


def picture(message: dict[str, Any], kind: str) -> np.ndarray:
    values = np.frombuffer(bytes.fromhex(message["data"]), kind)
    return values.reshape(message["height"], message["width"])


def points(message: dict[str, Any]) -> dict[str, np.ndarray]:
    """The fields of a cloud, by name."""
    values = np.frombuffer(bytes.fromhex(message["data"]), "<f4")
    names = [field["name"] for field in message["fields"]]
    return dict(zip(names, values.reshape(-1, len(names)).T, strict=True))


@needs_ros
def test_height_contact_markers_and_diagnostics_are_heard_on_topics(tmp_path: Path) -> None:
    height = np.zeros((6, 8), np.float32)
    height[1:4, 2:7] = 0.4
    contact = (height > 0).astype(np.uint8)
    figures = measure_contact(height, contact, PIXEL_MM)
    parts: dict[str, Any] = {
        "height": height,
        "contact": contact,
        "image": np.full((3, 6, 8), 0.5, np.float32),
        "shadow": np.zeros((6, 8), np.uint8),
        "markers": np.array([[2, 3, 1]], np.float32),
        "shift": np.array([[0.5, -1]], np.float32),
        "visible": np.ones(1, np.uint8),
        "pose": np.array([0.5, 0, 0, 0, 0, 0], np.float32),
        "covariance": np.eye(6, dtype=np.float32),
        "metrics": np.array(json.dumps(figures)),
    }
    np.savez(tmp_path / "touch.npz", **parts)
    heard = ask("publish", tmp_path / "touch.npz")
    assert heard["/pad/height"]["encoding"] == "32FC1"
    np.testing.assert_allclose(picture(heard["/pad/height"], "<f4"), height / 1000, rtol=1e-6)
    np.testing.assert_array_equal(picture(heard["/pad/contact"], "u1"), contact)
    found = points(heard["/pad/contacts"])
    assert found["x"] == pytest.approx([4 * 5e-5])
    assert found["y"] == pytest.approx([2 * 5e-5])
    assert found["z"] == pytest.approx([4e-4])
    assert found["area"] == pytest.approx([15 * 5e-5**2])
    moved = points(heard["/pad/markers"])
    assert moved["dx"] == pytest.approx([0.5 * 5e-5])
    assert moved["dy"] == pytest.approx([-1 * 5e-5])
    whole = heard["/pad/pose"]["pose"]
    assert whole["pose"]["position"]["x"] == pytest.approx((0.5 + 3.5 * PIXEL_MM) / 1000)
    assert len(bytes.fromhex(whole["covariance"])) == 8 * 36
    (status,) = heard["/diagnostics"]["status"]
    assert (status["level"], status["message"]) == (1, "too bright")
    assert heard["/pad/touch"]["data"] == "000007"


@pytest.fixture
def sensor(made_once: MadeOnce) -> Path:
    """A calibration and a touch of a small simulated sensor."""

    def make(folder: Path) -> None:
        simulated_sensor(folder, **SIZE)
        touch = {"radius_mm": 5.0, "rise_mm": 1.5, "out": folder / "touch", **SIZE}
        list(open_pipeline("simulate_press", touch).items())

    return made_once("ros2_sensor", make)


@pytest.fixture
def mini(made_once: MadeOnce) -> Path:
    return made_once("mini.npz", oneshot.calibrated)


@needs_ros
def test_camera_images_on_a_topic_give_heights_on_another(sensor: Path) -> None:
    heard = ask("graph", sensor / "cal.npz", sensor / "touch")
    height = 1000 * picture(heard["/tactograph/height"], "<f4")
    truth = np.load(sensor / "touch" / "truth_height_mm.npy")
    assert np.sqrt(np.mean((height - truth) ** 2)) < 0.03
    # The stamp is that of the camera's image.
    assert heard["/tactograph/height"]["header"]["stamp"]["sec"] in (1_699_999_999, 1_700_000_000)
    assert len(points(heard["/tactograph/contacts"])["x"]) == 1


def heard_of(words: list[str], frame: Path | None = None) -> dict[str, Any]:
    """What a listener hears of a graph that a user runs elsewhere, and ends by Ctrl-C."""
    kinds = {"height": "Image", "contact": "Image", "contacts": "PointCloud2", "touch": "String"}
    topics = {f"/pad/{name}": kind for name, kind in kinds.items()}
    with started("command", "run", *words, "namespace=pad", "--quiet") as run:
        try:
            heard = ask("listen", json.dumps(topics), frame or "")
        finally:
            run.send_signal(signal.SIGINT)
            try:
                _, output = run.communicate(timeout=60)
            finally:
                run.kill()  # or its end would be waited for without an end
    assert set(heard) == set(topics), output
    assert run.returncode == 0, output
    return {name: heard[f"/pad/{name}"] for name in kinds}


@needs_ros
def test_a_live_sensor_is_heard_in_another_process(sensor: Path, tmp_path: Path) -> None:
    scene = "&".join(f"{name}={value}" for name, value in SIZE.items())
    heard = heard_of(
        [
            "live_ros2", f"calibration={sensor / 'cal.npz'}", f"out={tmp_path}", "port=simulated",
            f"camera=simulated?{scene}&radius_mm=5&depth_mm=1.2&press_s=2&path_mm=1",
        ]
    )  # fmt: skip
    height = 1000 * picture(heard["height"], "<f4")
    depth = 1000 * points(heard["contacts"])["z"]
    assert depth == pytest.approx([height.max()], abs=0.3)
    assert 0 < depth < 1.4
    assert heard["touch"]["data"].isdecimal()


@needs_ros
def test_a_live_one_shot_sensor_is_heard_in_another_process(mini: Path, tmp_path: Path) -> None:
    heard = heard_of(
        ["live_oneshot_ros2", f"calibration={mini}", f"out={tmp_path}", f"camera={oneshot.MOVING}"]
    )
    height = 1000 * picture(heard["height"], "<f4")
    depth = 1000 * points(heard["contacts"])["z"]
    assert depth == pytest.approx([height.max()], abs=0.3)
    assert 0 < depth < 1


@needs_ros
def test_colour_images_on_a_topic_give_heights_on_another(mini: Path, tmp_path: Path) -> None:
    touch = SimulatedColourSensor(read_scene(oneshot.MOVING, ColourScene), start=0.0)
    deepest = 0.5 * touch.scene.press_s
    np.save(tmp_path / "frame.npy", touch.picture(deepest, 0))
    heard = heard_of(["ros2_oneshot", f"calibration={mini}"], tmp_path / "frame.npy")
    height = 1000 * picture(heard["height"], "<f4")
    assert np.sqrt(np.mean((height - touch.true_height(deepest)) ** 2)) < 0.03
    assert (picture(heard["contact"], "u1") == 1).any()


@needs_ros
def test_a_name_that_ros_refuses_is_one_line() -> None:
    refused = ask("refuse", "")["refused"]
    assert "`node_name`=not a name" in refused
    assert "\n" not in refused


@pytest.mark.skipif(HAS_ROS, reason="ROS 2 is here")
def test_without_ros_one_line_says_so() -> None:
    with pytest.raises(InputError, match="source its setup file"):
        RosNode("tactograph", "")


def image(data: np.ndarray, frame: str, encoding: str | None = None) -> Any:
    """An image as ROS hands it over."""
    body = dict(image_message("", 1_700_000_000_500_000_000, data, frame).body)
    header = body.pop("header")
    stamp = SimpleNamespace(**header["stamp"])
    body["encoding"] = encoding or body["encoding"]
    return SimpleNamespace(**body, header=SimpleNamespace(stamp=stamp, frame_id=frame))


def touches(leds: int = 3, *, one_shot: bool = False, bits: int | None = None) -> RosTouches:
    flat: F4 = np.ones((leds, 4, 5), np.float32)
    return RosTouches(CalibratedFilm(flat, np.zeros((4, 5), np.float32), one_shot), "bgr", bits)


@pytest.mark.parametrize(("dtype", "top"), [(np.uint8, 255), (np.uint16, 65535)])
def test_a_touch_is_whole_when_every_led_has_an_image(dtype: type, top: int) -> None:
    made = touches()
    came = [made.take(image(np.full((4, 5), 10 * k, dtype), f"led{k}")) for k in (2, 3, 1)]
    assert came[:2] == [None, None]
    np.testing.assert_allclose(came[2].image[:, 0, 0] * top, [10, 20, 30], rtol=1e-6)
    assert came[2].name == "000001"


def test_of_a_one_shot_sensor_every_image_is_a_touch() -> None:
    blue = np.zeros((4, 5, 3), np.uint8)
    blue[..., 0] = 255
    for encoding, lit in (("bgr8", 0), ("rgb8", 2)):
        touch = touches(one_shot=True).take(image(blue, "camera", encoding))
        assert touch.image[:, 0, 0].argmax() == lit


def test_a_camera_that_fills_12_of_16_bits_reaches_full_scale() -> None:
    made = touches(1, bits=12)
    touch = made.take(image(np.full((4, 5), 4095, np.uint16), "led1"))
    assert touch.image.max() == 1


@pytest.mark.parametrize(
    ("data", "frame", "encoding", "says"),
    [
        (np.zeros((4, 5), np.uint8), "led4", None, "led1 to led3 are known"),
        (np.zeros((4, 5), np.uint8), "camera", None, "led1 to led3 are known"),
        (np.zeros((4, 6), np.uint8), "led1", None, "6 x 4 pixels"),
        (np.zeros((4, 5, 3), np.uint8), "led1", None, "mono8 or mono16"),
        (np.zeros((4, 5), np.float32), "led1", None, "8 or 16 bits"),
        (np.zeros((4, 5), np.uint8), "led1", "yuv422", "yuv422"),
    ],
)
def test_messages_without_an_led_image_are_left_out_and_reported(
    data: np.ndarray, frame: str, encoding: str | None, says: str
) -> None:
    with collect_warnings([]) as notes:
        assert touches().take(image(data, frame, encoding)) is None
    assert says in notes[0]
    assert "\n" not in notes[0]
